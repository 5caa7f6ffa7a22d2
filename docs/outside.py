"""A preprocessor of mdBook: links to files that are not in the book become the text and the path of the file.

mdBook calls it as `python3 outside.py supports RENDERER`, and then with [context, book] in JSON on standard input.
"""

import json
import pathlib
import posixpath
import re
import sys

# Links of Markdown, with the `!` of pictures, which stay.
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\[\]]*\])*)\]\(([^()\s]+)\)")


def changed(text, page, pages):
    """The Markdown of a page whose links lead only to other pages."""

    def link(match):
        mark, shown, target = match.groups()
        path, _, part = target.partition("#")
        if mark or not path or re.match(r"[a-z]+:", target):
            return match.group(0)
        inside = posixpath.normpath(posixpath.join(posixpath.dirname(page), path))
        if inside in pages:
            return match.group(0).replace("README.md", "index.md")
        # Links of an included page of the repository are relative to that page.
        named = inside if inside.startswith("../") else path
        while named.startswith("../"):
            named = named[3:]
        return shown if named in shown else f"{shown} (`{named}`)"

    # A link may be broken into lines; blocks of code have none.
    parts = re.split(r"(^(?:```|~~~).*?^(?:```|~~~)\s*?$)", text, flags=re.DOTALL | re.MULTILINE)
    return "".join(part if i % 2 else LINK.sub(link, part) for i, part in enumerate(parts))


def chapters(items):
    for item in items:
        if isinstance(item, dict) and "Chapter" in item:
            yield item["Chapter"]
            yield from chapters(item["Chapter"]["sub_items"])


def main():
    if sys.argv[1:2] == ["supports"]:
        return
    _, book = json.load(sys.stdin)
    every = list(chapters(book.get("items") or book.get("sections")))
    # mdBook has already renamed each README to index; links use the old name.
    pages = {chapter[key] for chapter in every for key in ("path", "source_path") if chapter.get(key)}
    folder = pathlib.Path(__file__).parent
    pages |= {path.relative_to(folder).as_posix() for path in folder.rglob("*.svg")}
    for chapter in every:
        if chapter["path"]:
            chapter["content"] = changed(chapter["content"], chapter["source_path"], pages)
    json.dump(book, sys.stdout)


main()
