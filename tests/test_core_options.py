"""The stub of the core names the keys that the core reads of what comes by keyword."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
STUB = ROOT / "python/truearm/_core.pyi"
STRUCT = re.compile(
    r"#\[pyo3\(from_item_all\)\]\n(?:#\[.*\]\n)*(?:pub )?struct (\w+)(?:<[^>]*>)? \{\n(.*?)\n\}", re.DOTALL
)
FIELD = re.compile(r"^    (?:pub )?(\w+): (.*),$", re.MULTILINE)
NAMES = {
    ("measured", "Arrays"): "MeasuredArrays",
    ("estimate", "Options"): "ConstantOptions",
    ("field", "Options"): "FieldOptions",
    ("conservative", "Plan"): "BoundsPlan",
    ("conservative", "Stored"): "BoundsContent",
    ("compensate", "Keywords"): "CorrectorOptions",
    ("stream", "Keywords"): "StreamOptions",
    ("greedy", "Candidates"): "Candidates",
    ("choice", "Options"): "ChoiceOptions",
    ("cmac", "Options"): "NetworkOptions",
    ("cmac", "Training"): "TrainingOptions",
    ("cmac", "Fitting"): "NetworkFitOptions",
    ("regions", "Options"): "RegionalOptions",
    ("division", "Options"): "DivisionOptions",
    ("division", "Measuring"): "MeasuringOptions",
}


def read_by_keyword() -> dict[tuple[str, str], dict[str, bool]]:
    """Keys of each structure that the core reads by keyword, each with whether it may be None."""
    return {
        (path.stem, name): {key: kind.startswith("Option<") for key, kind in FIELD.findall(body)}
        for path in sorted((ROOT / "crates/python/src").glob("*.rs"))
        for name, body in STRUCT.findall(path.read_text())
    }


def stated() -> dict[str, dict[str, bool]]:
    """The same of each TypedDict of the stub."""
    kinds = [node for node in ast.parse(STUB.read_text()).body if isinstance(node, ast.ClassDef)]
    found: dict[str, dict[str, bool]] = {"TypedDict": {}}
    for kind in kinds:
        bases = [base.id for base in kind.bases if isinstance(base, ast.Name)]
        if bases and bases[0] in found:
            lines = [line for line in kind.body if isinstance(line, ast.AnnAssign)]
            own = {ast.unparse(line.target): ast.unparse(line.annotation) for line in lines}
            optional = {key: words.endswith("| None") for key, words in own.items()}
            found[kind.name] = found[bases[0]] | optional
    return found


def test_every_structure_has_its_type():
    assert read_by_keyword().keys() == NAMES.keys()
    sources = [path.read_text() for path in (ROOT / "crates/python/src").glob("*.rs")]
    assert sum(source.count("from_item_all") for source in sources) == len(NAMES)


@pytest.mark.parametrize("structure", NAMES, ids=NAMES.get)
def test_keys_are_those_that_the_core_reads(structure):
    assert stated()[NAMES[structure]] == read_by_keyword()[structure]


def test_what_comes_by_keyword_is_described_key_by_key():
    for kind in ast.parse(STUB.read_text()).body:
        if isinstance(kind, ast.ClassDef) and any(isinstance(line, ast.AnnAssign) for line in kind.body):
            words = ast.get_docstring(kind) or ""
            described = re.findall(r"^    (\w+): ", words, re.MULTILINE)
            own = [ast.unparse(line.target) for line in kind.body if isinstance(line, ast.AnnAssign)]
            assert described == own, kind.name
