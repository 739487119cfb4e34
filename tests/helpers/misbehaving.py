"""Work for a child process that goes wrong as asked."""

import os
import time


def prepare():
    pass


def work(how, *, tell):
    tell(how)
    if how == "hang":
        time.sleep(600.0)
    if how == "die":
        os._exit(3)
    if how == "fill memory":
        try:
            bytearray(2**40)
        except MemoryError:
            return "refused"
    return "well"
