"""Results of a fresh Python process, for tests of determinism and of the kernel cache."""

import json
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
# Whatever package is tested here is tested there.
PATH = os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])])


def in_another_process(code, **environment):
    """Run a program that may import the helpers; returns the JSON of its last line of output."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": PATH, **environment},
        cwd=HERE,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])
