# SPDX-License-Identifier: MIT
"""What a section of the page consists of. Blocks are made before anything is drawn, so that missing input is found first."""
import dataclasses
import pathlib
import typing


@dataclasses.dataclass
class Picture:
    path: pathlib.Path
    caption: str = ""


@dataclasses.dataclass
class Sheet:
    """Rows of pictures; more than `wrap` of a row go on below."""
    name: str
    rows: list
    wrap: int = 4


@dataclasses.dataclass
class Plot:
    """A figure that is drawn: `draw` returns a matplotlib figure."""
    name: str
    draw: typing.Callable
    caption: str = ""


@dataclasses.dataclass
class Table:
    head: list
    lines: list
    caption: str = ""


@dataclasses.dataclass
class Text:
    text: str


@dataclasses.dataclass
class Viewer:
    """The page of `skeletex view`."""
    path: pathlib.Path


@dataclasses.dataclass
class Section:
    anchor: str
    title: str
    make: typing.Callable  # of Results: its blocks
    figures: str = ""  # of the paper: "Figures 4 and 11"
    numbers: tuple = ()  # the same as anchors: ("fig-4", "fig-11")
    experiments: tuple = ()
    paper: str = ""  # what the paper shows
    here: str = ""  # what this section shows, true of any model
    differs: str = ""  # where the two differ, and why
    remark: str = ""  # what is seen on the standard models
