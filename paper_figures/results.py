# SPDX-License-Identifier: MIT
"""Reads what `skeletex run` wrote, and says what is missing."""
import json
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent


class MissingInput(Exception):
    """What is missing, and how to make it."""


class Results:
    """The results of a run: a folder with a folder per experiment."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self._read = {}

    def __repr__(self):
        return str(self.folder)

    def has(self, experiment):
        return (self.folder / experiment / "results.json").is_file()

    def experiments(self):
        return sorted(path.parent.name for path in self.folder.glob("*/results.json"))

    def _json(self, experiment, name):
        path = self.folder / experiment / name
        if path not in self._read:
            try:
                self._read[path] = json.loads(path.read_text())
            except FileNotFoundError:
                raise MissingInput(f"{path} is missing; make it with skeletex run configs/experiments/{experiment}.json") from None
            except json.JSONDecodeError as error:
                raise MissingInput(f"{path} is damaged ({error}); make it again with skeletex run configs/experiments/{experiment}.json") from None
        return self._read[path]

    def all_rows(self, experiment):
        """Every row, those that failed too."""
        return self._json(experiment, "results.json")["rows"]

    def rows(self, experiment):
        """The rows that are done."""
        rows = [row for row in self.all_rows(experiment) if row["status"] == "done"]
        if not rows:
            raise MissingInput(f"{self.folder / experiment}: no item is done; its results.csv has the reasons")
        return rows

    def failed(self, experiment):
        return [row for row in self.all_rows(experiment) if row["status"] != "done"]

    def item(self, experiment, key):
        """Everything that the commands of an item reported."""
        return self._json(experiment, f"items/{key}.json")["steps"]

    def record(self, experiment):
        return self._json(experiment, "record.json")

    def file(self, experiment, name):
        path = self.folder / experiment / name
        if not path.is_file():
            raise MissingInput(f"{path} is missing; make it with skeletex run configs/experiments/{experiment}.json")
        return path

    def models(self, experiment):
        return unique(row["model"] for row in self.rows(experiment))

    def parameters(self, experiment, name):
        return unique(row["parameters"][name] for row in self.rows(experiment))

    def is_of_own_model(self):
        return any(self.record(experiment)["source"]["models"] for experiment in self.experiments())


def unique(values):
    return list(dict.fromkeys(values))


def symmetric(columns):
    """Mean distance of two surfaces, both directions, divided by the diagonal."""
    return (columns["forward_mean"] + columns["backward_mean"]) / 2


def largest(columns):
    return max(columns["forward_max"], columns["backward_max"])


def state_of_checkout(record):
    """"" for a run of a clean checkout, else what is not known of it."""
    git = record["git"]
    if not git["commit"]:
        return "made outside of a git checkout"
    if git["changed_files"] != "0":
        return f"made with {git['changed_files']} changed files"
    return ""
