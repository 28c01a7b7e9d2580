#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Writes docs/replication.md: docs/replication/template.md with every number filled in from results/reference.

    paper_figures/replication.py            # writes the article
    paper_figures/replication.py --check    # says whether the committed article is that of the committed results
"""
import argparse
import difflib
import pathlib
import re
import string
import sys
import textwrap

import numbers_of_run
from results import ROOT, MissingInput, Results

ARTICLE = ROOT / "docs" / "replication.md"
TEMPLATE = ROOT / "docs" / "replication" / "template.md"

# What looks like a measured number: with a decimal point, an exponent, a percent sign or a unit of time. Those are filled in, never typed.
MEASURED = re.compile(r"\d\.\d|\d(?:\.\d+)?e[-+]?\d|\d+ ?%|\d ms\b")


def fill(results):
    text = TEMPLATE.read_text()
    typed = [f"{TEMPLATE}:{number}: {line.strip()}" for number, line in enumerate(text.splitlines(), 1) if MEASURED.search(re.sub(r"\$\w+", "$", line))]
    if typed:
        raise ValueError("numbers that are typed, not filled in:\n" + "\n".join(typed))
    values = numbers_of_run.article(results)
    template = string.Template(text)
    names = set(re.findall(r"\$(\w+)", text))
    if unknown := names - values.keys():
        raise ValueError(f"{TEMPLATE} names numbers that numbers_of_run.py does not have: {', '.join(sorted(unknown))}")
    if unused := values.keys() - names:
        raise ValueError(f"numbers_of_run.py makes numbers that {TEMPLATE} does not name: {', '.join(sorted(unused))}")
    return _wrapped(template.substitute(values))


def _wrapped(text):
    """Paragraphs and list entries at 120 columns, as filled in numbers are shorter than their names; tables and code as they are."""
    parts = []
    for part in text.split("\n\n"):
        if part[0] in "|#* " and not part.startswith("**") and not part.startswith("*A "):
            parts.append(part)
            continue
        entries = re.split(r"\n(?=\d+\. )", part)
        parts.append("\n".join(textwrap.fill(" ".join(entry.split()), 120, subsequent_indent="   " if re.match(r"\d+\. ", entry) else "", break_long_words=False, break_on_hyphens=False)
                               for entry in entries))
    return "\n\n".join(parts) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="?", type=pathlib.Path, default=ROOT / "results" / "reference")
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 and say where the article differs")
    arguments = parser.parse_args()
    try:
        text = fill(Results(arguments.results))
    except (MissingInput, ValueError) as error:
        sys.exit(f"replication: {error}")
    if not arguments.check:
        temporary = ARTICLE.with_suffix(".tmp")
        temporary.write_text(text)
        temporary.replace(ARTICLE)
        print(ARTICLE)
        return
    committed = ARTICLE.read_text()
    if committed != text:
        sys.exit("".join(difflib.unified_diff(committed.splitlines(True), text.splitlines(True), "docs/replication.md", "from the results"))
                 + "replication: docs/replication.md is not that of the results; write it anew with paper_figures/replication.py")


if __name__ == "__main__":
    main()
