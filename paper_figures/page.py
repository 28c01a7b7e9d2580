# SPDX-License-Identifier: MIT
"""One self-contained page: blocks and sections as HTML."""
import base64
import functools
import html
import io

from PIL import Image

import style
from blocks import Plot, Sheet, Table, Text, Viewer
from results import state_of_checkout, unique

CSS = """
:root{color-scheme:light}
body{font:17px/1.5 system-ui,sans-serif;max-width:1500px;margin:0 auto;padding:1rem 2rem 4rem;color:#1d1d1f;background:#fff}
p,ul{max-width:80ch;overflow-wrap:anywhere}h1{font-size:2rem;margin:.5rem 0}h2{font-size:1.5rem;margin:3.5rem 0 .5rem;border-top:1px solid #ddd;padding-top:1.2rem}
h2 small{font-size:1rem;color:#666;font-weight:normal;margin-left:.6rem}a{color:#1b4f9c}
img{width:100%;height:auto;display:block}figure{margin:0}figcaption{font-size:.95rem;padding:.2rem .2rem .8rem;color:#333}
.sheet{display:grid;gap:.4rem 1rem;margin:1rem 0;align-items:end}.sheet img{cursor:zoom-in}.plot{margin:1rem 0}
.scroll{overflow-x:auto;margin:.8rem 0}table{border-collapse:collapse;font-size:.95rem}caption{text-align:left;font-weight:600;padding:.3rem 0}
td,th{padding:.25rem .8rem;text-align:right;border-bottom:1px solid #ddd;vertical-align:top}td:first-child,th:first-child{text-align:left}
table:not(.words) td{white-space:nowrap}table td.long{white-space:normal;min-width:40ch}table.words td,table.words th{text-align:left}thead th{border-bottom:2px solid #999}
.quiet{color:#555;font-size:.9rem}.bad{background:#fdecea;border-left:5px solid #c0392b;padding:.6rem 1rem;max-width:none}
details{margin:.6rem 0}summary{cursor:pointer}nav ol{columns:2;max-width:none;font-size:.95rem}nav .map{max-width:none;line-height:2}
nav .map a{display:inline-block;border:1px solid #ccd;border-radius:5px;padding:0 .5rem;margin:0 .15rem;text-decoration:none}
iframe{width:100%;height:800px;border:1px solid #ccc;border-radius:6px}dialog{border:0;padding:0;max-width:98vw;max-height:98vh;background:#fff}dialog img{width:auto;max-width:98vw;max-height:97vh;cursor:zoom-out}
@media(max-width:800px){body{padding:1rem}.sheet{grid-template-columns:1fr 1fr!important}nav ol{columns:1}}@media print{.sheet figure,.plot{break-inside:avoid}iframe{display:none}}
"""

# Pictures open at full size; the page of `view` starts when it comes into sight.
SCRIPT = """
const shown = document.querySelector('dialog');
document.addEventListener('click', event => {
  if (event.target.closest('.sheet') && event.target.tagName === 'IMG') {
    shown.firstElementChild.src = event.target.src;
    shown.firstElementChild.alt = event.target.alt;
    shown.showModal();
  } else if (event.target.closest('dialog')) shown.close();
});
const bytesOf = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
const seen = new IntersectionObserver(entries => {
  for (const {target, isIntersecting} of entries) if (isIntersecting && !target.src) {
    const text = document.getElementById(target.dataset.page).textContent;
    target.src = URL.createObjectURL(new Blob([bytesOf(text)], {type: 'text/html'}));
  }
}, {rootMargin: '200px'});
document.querySelectorAll('iframe[data-page]').forEach(frame => seen.observe(frame));
"""


def escape(text):
    return html.escape(str(text))


def _data(kind, content):
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


@functools.lru_cache(maxsize=None)
def _picture_data(path):
    """As WebP, a fifth of the bytes of PNG."""
    content = io.BytesIO()
    Image.open(path).convert("RGB").save(content, "WEBP", quality=90, method=4)
    return _data("image/webp", content.getvalue())


def table(block, words=False):
    head = "".join(f"<th>{escape(cell)}</th>" for cell in block.head)
    body = "".join("<tr>" + "".join(f"<td{' class=long' if len(str(cell)) > 60 else ''}>{cell if words else escape(cell)}</td>" for cell in line) + "</tr>" for line in block.lines)
    caption = f"<caption>{escape(block.caption)}</caption>" if block.caption else ""
    return f"<div class=scroll><table{' class=words' if words else ''}>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"


def _sheet(block, folder):
    style.save_sheet(block, folder)
    columns = max(2, min(block.wrap, max(len(row) for row in block.rows)))  # no picture is enlarged
    lines = []
    for row in block.rows:
        figures = "".join(f'<figure><img alt="{escape(picture.caption)}" src="{_picture_data(picture.path)}"><figcaption>{escape(picture.caption)}</figcaption></figure>' for picture in row)
        lines.append(f'<div class=sheet style="grid-template-columns:repeat({columns},1fr)">{figures}</div>')
    return "".join(lines)


def _plot(block, folder):
    text = style.save(block.draw(), folder, block.name)
    caption = f"<figcaption>{escape(block.caption)}</figcaption>" if block.caption else ""
    return f'<figure class=plot><img alt="{escape(block.caption or block.name)}" src="{_data("image/svg+xml", text.encode())}">{caption}</figure>'


def _viewer(block, _):
    name = f"page-{block.path.stem}"
    content = base64.b64encode(block.path.read_bytes()).decode()
    return f'<script type="text/plain" id="{name}">{content}</script><iframe title="{escape(block.path.stem)}" data-page="{name}"></iframe>'


def block_html(block, folder):
    if isinstance(block, Text):
        return f"<p>{escape(block.text)}</p>"
    if isinstance(block, Table):
        return table(block)
    return {Sheet: _sheet, Plot: _plot, Viewer: _viewer}[type(block)](block, folder)


def _cell(value):
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def _all_numbers(results, experiment):
    rows = results.all_rows(experiment)
    columns = unique(column for row in rows for column in row["columns"])
    failed = "".join(f"<p class=bad>Failed: {escape(row['key'])}: {escape(row.get('reason', ''))}</p>" for row in results.failed(experiment))
    lines = [[row["key"]] + [_cell(row["columns"].get(column)) for column in columns] for row in rows]
    return failed + f"<details><summary>All numbers of the experiment {escape(experiment)} ({len(rows)} rows)</summary>{table(Table(['item'] + columns, lines))}</details>"


def _record(results, experiment):
    record = results.record(experiment)
    state = state_of_checkout(record)
    parts = [f"experiment {experiment}", record.get("date", "")[:10], f"commit {record['git']['commit'][:10] or 'unknown'}" + (f", {state}" if state else ""), record["device"]["name"],
             f"{record['seconds']:.0f} s", f"peak {record['peak_memory_mb']:.0f} MB"]
    links = "".join(f' · <a download="{experiment}.{name.split(".")[-1]}" href="{_data("text/plain", results.file(experiment, name).read_bytes())}">{text}</a>'
                    for name, text in (("results.csv", "numbers (CSV)"), ("record.json", "record (JSON)")))
    return f"<p class=quiet>{escape(', '.join(part for part in parts if part))}{links} · again: <code>skeletex run configs/experiments/{experiment}.json</code></p>"


def section(entry, blocks, results, folder, is_own):
    text = "".join(f"<a id={anchor}></a>" for anchor in entry.numbers)
    text += f"<h2 id={entry.anchor}>{escape(entry.title)}<small>{escape(entry.figures)}{' of the paper' if entry.figures and is_own else ''}</small></h2>"
    for name, words in (("The paper", entry.paper if not is_own else ""), ("Here", entry.here)):
        text += f"<p>{'' if is_own else f'<b>{name}.</b> '}{escape(words)}</p>" if words else ""
    text += "".join(block_html(block, folder) for block in blocks)
    if not is_own:
        text += f"<p><b>Differences.</b> {escape(entry.differs)}</p>" if entry.differs else ""
        text += f"<p>{escape(entry.remark)}</p>" if entry.remark else ""
    for experiment in entry.experiments:
        text += _all_numbers(results, experiment) + _record(results, experiment)
    return text


def document(title, parts):
    return (f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width,initial-scale=1"><title>{escape(title)}</title><style>{CSS}</style></head>'
            f"<body>{''.join(parts)}<dialog><img alt=''></dialog><script>{SCRIPT}</script></body></html>\n")
