"""In docstrings ``name : what it is`` becomes an item of a list, so that each stands alone."""

import re

from griffe import Extension

NAME = r"[a-z_]\w*"
# At the start of a line, or after the end of a sentence.
ITEM = re.compile(rf"(?:^|\n|(?<=[.;]) )({NAME}(?:, {NAME})*) : ")


def listed(paragraph):
    text = re.sub(r"\n +", "\n", paragraph)
    before, *parts = ITEM.split(text)
    items = [f"- `{names}`: {what}" for names, what in zip(parts[::2], parts[1::2], strict=True)]
    folded = "\n".join(item.replace("\n", " ") for item in items)
    return f"{before}\n\n{folded}" if items else paragraph


class ListedParameters(Extension):
    def on_object(self, *, obj, **_):
        if obj.docstring:
            paragraphs = obj.docstring.value.split("\n\n")
            obj.docstring.value = "\n\n".join(map(listed, paragraphs))
