#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""One self-contained page with every figure and table of the paper, and every figure as a file.

    paper_figures/report.py [RESULTS] [--draft]     # default: results/; writes RESULTS/figures/ and RESULTS/report/index.html

The page is made of complete runs of a clean checkout. Missing input is an error (exit code 1), and so is a record of changed files;
--draft makes the page of what there is, and says so at its top.
"""
import argparse
import datetime
import pathlib
import sys

import numbers_of_run
import page
import sections
from blocks import Plot, Sheet, Table
from results import ROOT, MissingInput, Results, state_of_checkout, unique


def check(results, wanted):
    """Blocks of every section, and what is missing or wrong."""
    made, missing = [], []
    for section in wanted:
        try:
            for experiment in section.experiments:
                results.all_rows(experiment)
                results.record(experiment)
            made.append((section, section.make(results)))
        except MissingInput as error:
            missing.append((section, str(error)))
        except (KeyError, StopIteration, IndexError) as error:
            missing.append((section, f"{results}: the numbers for \"{section.title}\" are not those of this version ({type(error).__name__}: {error}); run {', '.join(section.experiments) or 'its experiments'} again"))
    unclean = [f"{results.folder / experiment / 'record.json'}: {state_of_checkout(results.record(experiment))}" for experiment in results.experiments() if state_of_checkout(results.record(experiment))]
    failed = [f"{experiment}, {row['key']}: {row.get('reason', '')}" for experiment in results.experiments() for row in results.failed(experiment)]
    return made, missing, unclean, failed


def head(results, is_own, now):
    records = [results.record(experiment) for experiment in results.experiments()]
    dates = sorted(record["date"][:10] for record in records if record.get("date"))
    commits = unique(record["git"]["commit"][:10] or "unknown" for record in records)
    items = sum(record["items"]["done"] for record in records)
    machine, device = records[0]["machine"], records[0]["device"]
    model = results.models("fidelity")[0] if is_own and results.has("fidelity") else ""
    lines = [["Page written", now.strftime("%d %B %Y, %H:%M UTC")], ["Runs", (f"{dates[0]} to {dates[-1]}, " if dates and dates[0] != dates[-1] else f"{dates[0]}, " if dates else "")
             + f"{len(records)} experiments, {items} items, {sum(record['seconds'] for record in records) / 60:.0f} minutes" + (", reduced (--quick)" if any(record["source"].get("quick") for record in records) else "")],
             ["Version", f"skeletex {records[0]['version']}, commit {', '.join(commits)}, {records[0]['compiler']}"],
             ["Machine", f"{machine['processor']}, {machine['cores']} cores, {machine['system']}"], ["OpenCL device", f"{device['name']} ({device['platform']}, {device['driver']})"]]
    title = f"{model}: what a texture makes of it" if is_own else "Skeletex: the paper's figures and tables, made anew"
    text = f"<h1>{page.escape(title)}</h1>"
    if not is_own:
        text += ("<p>The paper <i>Skeletex</i> (2018) stores a mesh as a skeleton and one texture of displacements. This page shows every figure and table of it: made by this program on meshes that "
                 "Debian distributes, or drawn from the formulas. <b>The paper</b> says what it shows, <b>Here</b> what we show, <b>Differences</b> where the two part, and why. Distances are divided by the diagonal of "
                 "the mesh's bounding box. Click a picture to see it at full size.</p>")
    else:
        text += "<p>Distances are divided by the diagonal of the mesh's bounding box. Click a picture to see it at full size.</p>"
    return title, text + page.table(Table(["", ""], [[page.escape(cell) for cell in line] for line in lines]), words=True).replace("<thead><tr><th></th><th></th></tr></thead>", "")


def summary(results, is_own):
    if is_own:
        rows = [[page.escape(what), f"<b>{page.escape(here)}</b>", f"<a href='#{anchor}'>more</a>"] for what, here, anchor in numbers_of_run.own_summary(results)]
        return "<h2 id=summary>In five numbers</h2>" + page.table(Table(["", "", ""], rows), words=True)
    rows = [[page.escape(what), f"<b>{page.escape(here)}</b>", page.escape(paper), f"<a href='#{anchor}'>more</a>"] for what, here, paper, anchor in numbers_of_run.summary(results)]
    return "<h2 id=summary>In five numbers</h2>" + page.table(Table(["", "here", "the paper", ""], rows), words=True)


def contents(made, is_own):
    places = {anchor: section for section, _ in made for anchor in section.numbers}
    text = "<nav><h2 id=contents>Contents</h2>"
    if not is_own:
        names = [(f"fig-{number}", f"Figure {number}") for number in range(1, 21)] + [("table-1", "Table 1")]
        text += "<p class=map>" + " ".join(f"<a href='#{anchor}'>{name}</a>" for anchor, name in names if anchor in places) + "</p>"
    place = " of the paper" if is_own else ""
    items = "".join(f"<li><a href='#{section.anchor}'>{page.escape(section.title)}</a>{f' ({page.escape(section.figures)}{place})' if section.figures else ''}</li>" for section, _ in made)
    return f"{text}<ol>{items}</ol></nav>"


def draft_note(missing, unclean, failed, is_own):
    parts = []
    if missing:
        parts.append("<b>This is a draft.</b> Missing: " + "; ".join(page.escape(section.title) for section, _ in missing) + ".")
    if unclean:
        parts.append(f"{'' if is_own else '<b>This is a draft.</b> '}{len(unclean)} of the runs were made with changed files or outside of a git checkout: their commit does not tell what ran.")
    if failed:
        parts.append(f"{len(failed)} items failed: " + "; ".join(page.escape(text) for text in failed[:5]))
    return "".join(f"<p class=bad>{part}</p>" for part in parts)


def links(is_own):
    files = [("replication.md", "the same as an article"), ("how-it-works.md", "how the program works, and what differs from the paper"), ("glossary.md", "terms"), ("convert.md", "options of encode"),
             ("sweep.md", "how to run experiments")]
    listed = ", ".join(f"<code>docs/{name}</code> ({text})" for name, text in files if not (is_own and name == "replication.md"))
    return f"<h2>More</h2><p>In the repository: {listed}. Every section has its numbers and its record to download, and the command that makes them again.</p>"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="?", type=pathlib.Path, default=ROOT / "results")
    parser.add_argument("--draft", action="store_true", help="also from a part of the experiments, and from changed files")
    arguments = parser.parse_args()
    results = Results(arguments.results)
    if not results.experiments():
        sys.exit(f"report: {results} holds no results; run scripts/reproduce.sh --quick, or skeletex run configs/paper.json")
    is_own = results.is_of_own_model()
    made, missing, unclean, failed = check(results, sections.OWN if is_own else sections.PAPER)
    problems = unique(text for _, text in missing) + ([] if is_own else unclean)
    if problems and not arguments.draft or not made:
        hint = " results/reference holds numbers and small figures only." if (ROOT / "results" / "reference").resolve() == results.folder.resolve() else ""
        sys.exit("report: no page was made:" + "".join(f"\n  {problem}" for problem in problems) + f"\nRun what is missing from a clean checkout (scripts/reproduce.sh), or make a draft with --draft.{hint}")
    now = datetime.datetime.now(datetime.timezone.utc)
    title, text = head(results, is_own, now)
    parts = [text, draft_note(missing, unclean, failed, is_own)]
    try:
        parts.append(summary(results, is_own))
    except (MissingInput, StopIteration, KeyError):
        if not arguments.draft:
            raise
        parts.append("<p class=bad>No summary: it needs experiments that are missing.</p>")
    parts.append(contents(made, is_own))
    folder = results.folder / "figures"
    parts += [page.section(section, blocks, results, folder, is_own) for section, blocks in made]
    drawn = {block.name for _, blocks in made for block in blocks if isinstance(block, (Plot, Sheet))}
    for old in [path for path in folder.iterdir() if path.suffix in (".png", ".pdf") and path.stem not in drawn]:
        old.unlink()
    parts.append(links(is_own))
    target = results.folder / "report" / "index.html"
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_suffix(".tmp")
    temporary.write_text(page.document(title, parts))
    temporary.replace(target)
    print(target)


if __name__ == "__main__":
    try:
        main()
    except MissingInput as error:
        sys.exit(f"report: {error}")
