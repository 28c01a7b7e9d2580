#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""From experiments to the page: a part of the quick suite is run anew, its numbers are held against the committed reference run
(results/reference), the page is drawn from it, and opened in a browser.

    report_test.py PROGRAM SOURCE WORK BROWSER
"""
import html
import json
import pathlib
import re
import shutil
import subprocess
import sys

PROGRAM, SOURCE, WORK, BROWSER = (pathlib.Path(argument) for argument in sys.argv[1:5])
REFERENCE = SOURCE / "results" / "reference"
RUNS = [("fidelity", ["--only", "bear", "--set", "sweep.size=[32,128]"]), ("segments", ["--only", "bear"]), ("limits", []), ("topology", ["--only", "knot1"]),
        ("simplification", ["--only", "armadillo", "--set", "sweep.size=[32]"]), ("draco", ["--only", "armadillo", "--set", "sweep.bits=[10]"])]
# Relative; other devices round otherwise, and a maximum hangs on single points. What is named otherwise is exact: counts, genus, closed.
TOLERANCES = {"_mean": 0.02, "_std": 0.05, "_max": 0.2, "bytes": 0.02, "_fraction": 0.02}
UNCOMPARED = ("_ms", "_s", "_mb")

# Counts in the browser what a reader would miss.
PROBE = """<script>
window.problems = [];
window.addEventListener("error", event => window.problems.push(event.message || "cannot load " + event.target.tagName), true);
window.addEventListener("load", () => {
  const images = [...document.images];
  for (const image of images) if (!image.complete || image.naturalWidth === 0) window.problems.push("broken image: " + image.alt);
  const verdict = document.createElement("p");
  verdict.id = "verdict";
  verdict.textContent = JSON.stringify({images: images.length, tables: document.querySelectorAll("table").length, headings: document.querySelectorAll("h2").length,
                                        overflow: document.documentElement.scrollWidth > window.innerWidth, problems: window.problems});
  document.body.append(verdict);
});
</script>"""


def fail(message):
    sys.exit(f"report_test: {message}")


def rows(folder, experiment):
    return {row["key"]: row for row in json.loads((folder / experiment / "results.json").read_text())["rows"]}


def differences(expected, found):
    for column, value in expected.items():
        other = found.get(column)
        if column.endswith(UNCOMPARED) or column == "device":
            continue
        tolerance = next((tolerance for ending, tolerance in TOLERANCES.items() if column.endswith(ending)), 0)
        if isinstance(value, (int, float)) and isinstance(other, (int, float)):
            if abs(value - other) > tolerance * abs(value):
                yield f"{column}: {other}, the reference has {value}"
        elif value != other:
            yield f"{column}: {other}, the reference has {value}"


def run_experiments():
    compared = 0
    for experiment, options in RUNS:
        subprocess.run([PROGRAM, "run", SOURCE / "configs" / "experiments" / f"{experiment}.json", "--quick", *options, "-o", WORK], check=True, stdout=subprocess.DEVNULL)
        expected = rows(REFERENCE, experiment)
        for key, row in rows(WORK, experiment).items():
            if row["status"] != "done":
                fail(f"{experiment}, {key}: {row.get('reason')}")
            if key not in expected:
                fail(f"{experiment}: the reference run lacks {key}; make it again with scripts/reference.sh")
            for difference in differences(expected[key]["columns"], row["columns"]):
                fail(f"{experiment}, {key}, {difference}")
            compared += 1
    return compared


def open_page(page):
    probed = page.with_name("probed.html")
    text = page.read_text()
    if "</head>" in text or "<body>" not in text:
        fail(f"{page} is not what the probe expects")
    probed.write_text(text.replace("<body>", PROBE + "<body>", 1))
    process = subprocess.run([BROWSER, "--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1300,1000", f"--user-data-dir={WORK / 'browser'}", "--dump-dom",
                              f"file://{probed.resolve()}"], capture_output=True, text=True, timeout=120)
    found = re.search(r'<p id="verdict">(.*?)</p>', process.stdout)
    if not found:
        fail(f"the browser did not come to the page's end:\n{process.stderr[-2000:]}")
    return json.loads(html.unescape(found.group(1)))


def main():
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    compared = run_experiments()
    page = pathlib.Path(subprocess.run([sys.executable, SOURCE / "paper_figures" / "report.py", WORK], check=True, capture_output=True, text=True).stdout.strip())
    verdict = open_page(page)
    if verdict["problems"]:
        fail("; ".join(verdict["problems"]))
    if verdict["images"] < 3 or verdict["tables"] < 4 or verdict["headings"] < 4:
        fail(f"the page lacks parts: {verdict}")
    if verdict["overflow"]:
        fail("the page is wider than its window")
    # The probe itself must see a broken image.
    broken = page.with_name("broken.html")
    broken.write_text(re.sub(r"data:image/png;base64,[^\"]{40}", "data:image/png;base64,", page.read_text(), count=1))
    if len(open_page(broken)["problems"]) == 0:
        fail("a broken image is not found")
    print(f"{compared} rows agree with the reference run; {verdict['images']} images, {verdict['tables']} tables, no problem in the browser")


main()
