"""The house keeps its own rules: layers of crates, sizes of files and functions, one version."""

import ast
import importlib.metadata
import importlib.resources
import json
import re
import shutil
import subprocess
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

from truearm import _core

# What identifies an arm, and what controllers run, which has no part of it.
SPINES = [
    ["truearm-kinematics", "truearm-estimate", "truearm-field", "truearm-python"],
    ["truearm-kinematics", "truearm-bank", "truearm-compensate", "truearm-capi"],
]
BESIDE = ["truearm-text", "truearm-inverse", "truearm-clearance"]
CRATES = [
    "truearm-kinematics",
    *BESIDE,
    "truearm-bank",
    "truearm-compensate",
    "truearm-capi",
    "truearm-estimate",
    "truearm-field",
    "truearm-python",
]
LONGEST_FILE = 500
LONGEST_FUNCTION = 60
ROOT = Path(__file__).resolve().parents[1]
PYTHON_FILES = [
    path
    for folder in ("python", "tests", "benches", "docs", "examples")
    for path in sorted((ROOT / folder).rglob("*.py"))
]
RUST_FILES = sorted((ROOT / "crates").rglob("*.rs"))


@pytest.fixture(scope="module")
def workspace() -> dict[str, list[str]]:
    """The crates of the workspace, each with those of ours that it depends on."""
    cargo = shutil.which("cargo")
    if cargo is None:
        pytest.skip("cargo is not on the path")
    command = [cargo, "metadata", "--format-version", "1", "--no-deps", "--offline"]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    packages = json.loads(found.stdout)["packages"]
    return {
        package["name"]: [d["name"] for d in package["dependencies"] if d["name"].startswith("truearm-")]
        for package in packages
    }


def test_crates_depend_one_way(workspace):
    assert sorted(workspace) == sorted(CRATES)
    for crate, needed in workspace.items():
        below = CRATES[: CRATES.index(crate)]
        assert set(needed) <= set(below), f"{crate} may depend on {below} only"


def test_each_crate_stands_on_the_one_below(workspace):
    for spine in SPINES:
        for lower, upper in pairwise(spine):
            assert lower in workspace[upper]


def test_no_unit_test_is_in_a_crate_without_their_harness():
    for manifest in (ROOT / "crates").glob("*/Cargo.toml"):
        if not tomllib.loads(manifest.read_text()).get("lib", {}).get("test", True):
            sources = sorted((manifest.parent / "src").rglob("*.rs"))
            assert sources, manifest
            assert not [path for path in sources if "#[test]" in path.read_text()], manifest


def test_one_version_for_all():
    workspace = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]
    version = workspace["package"]["version"]
    for manifest in (ROOT / "crates").glob("*/Cargo.toml"):
        assert tomllib.loads(manifest.read_text())["package"]["version"] == {"workspace": True}, manifest
    assert "version" in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dynamic"]
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text()
    assert _core.__version__ == importlib.metadata.version("truearm")


def test_type_checkers_find_the_types_of_the_package():
    package = importlib.resources.files("truearm")
    assert package.joinpath("py.typed").is_file()
    assert package.joinpath("_core.pyi").is_file()


def test_units_are_defined_in_one_module():
    units = ROOT / "python/truearm/units.py"
    known = set(_assigned(units))
    assert "MM_PER_METRE" in known
    again = {
        str(path.relative_to(ROOT)): found
        for path in sorted((ROOT / "python").rglob("*.py"))
        if path != units and (found := sorted(known.intersection(_assigned(path))))
    }
    assert again == {}


def _assigned(path: Path) -> list[str]:
    """Constants that a module assigns."""
    lines = [
        node for node in ast.parse(path.read_text()).body if isinstance(node, ast.Assign | ast.AnnAssign)
    ]
    targets = [
        ast.unparse(node.targets[0] if isinstance(node, ast.Assign) else node.target) for node in lines
    ]
    return [name for name in targets if name.isupper()]


def test_nothing_asks_for_one_processor():
    settings = [*ROOT.glob(".cargo/*"), *ROOT.rglob("Cargo.toml"), ROOT / "pyproject.toml", ROOT / "Makefile"]
    asking = [
        str(path) for path in settings if ".venv" not in path.parts and "target-cpu" in path.read_text()
    ]
    assert asking == [], "one wheel serves all x86-64 machines: the instruction set is chosen at run time"


@pytest.mark.parametrize("path", PYTHON_FILES + RUST_FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_are_short(path):
    lines = len(path.read_text().splitlines())
    assert lines <= LONGEST_FILE, "one idea, one file: divide it"


def test_least_squares_say_what_counts_as_zero():
    """NumPy before 2 has another default, and warns of it."""
    trees = {path: ast.parse(path.read_text()) for path in PYTHON_FILES if "lstsq(" in path.read_text()}
    calls = [
        (path, node) for path, tree in trees.items() for node in ast.walk(tree) if isinstance(node, ast.Call)
    ]
    silent = [
        f"{path.relative_to(ROOT)}:{call.lineno}"
        for path, call in calls
        if ast.unparse(call.func) == "np.linalg.lstsq" and "rcond" not in {word.arg for word in call.keywords}
    ]
    assert silent == []


@pytest.mark.parametrize("path", PYTHON_FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_python_functions_are_short(path):
    tree = ast.parse(path.read_text())
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    bodies = [
        (node.lineno, node.name, (node.end_lineno or 0) - node.body[0].lineno + 1) for node in functions
    ]
    assert [body for body in bodies if body[-1] > LONGEST_FUNCTION] == []


def test_kernels_are_inlined_into_their_instruction_set():
    """A kernel that is not inlined is compiled for the plainest machine: ten times slower, same results."""
    kernel = re.compile(r"(?P<before>.*)\n+ *fn run<I: Isa>\(self\).*\{$", re.MULTILINE)
    found = [(path, match["before"]) for path in RUST_FILES for match in kernel.finditer(path.read_text())]
    plain = [str(path.relative_to(ROOT)) for path, before in found if "#[inline(always)]" not in before]
    assert found
    assert plain == []


def test_make_says_what_there_is():
    make = shutil.which("make")
    if make is None:
        pytest.skip("make is not on the path")
    command = [make, "--no-print-directory", "help"]
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    listed = {line.split()[1] for line in told.splitlines()}
    declared = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert declared is not None
    steps = {"help", "py-check", "rust-check", "rust-test", "py-test", "clean"}
    assert listed == set(declared[1].split()) - steps
