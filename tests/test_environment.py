"""pyproject.toml, environment.yml, constraints.txt and the Makefile agree with each other."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]

# Where conda-forge's name is not the one on PyPI.
CONDA_NAMES = {
    "build": "python-build",
    "opencv-python-headless": "opencv",
    "playwright": "playwright-python",
    "soundfile": "pysoundfile",
    "soxr": "soxr-python",
    "torch": "pytorch",
}


def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def requirements(*extras: str) -> list[Requirement]:
    """The core dependencies and those of the named extras."""
    lines = list(project()["dependencies"])
    for extra in extras:
        lines += project()["optional-dependencies"][extra]
    return [Requirement(line) for line in lines]


def pins() -> dict[str, str]:
    """Name -> version of constraints.txt for this Python; a line that is no exact pin fails here."""
    found = {}
    for line in (ROOT / "constraints.txt").read_text("utf-8").splitlines():
        if line and not line.startswith("#"):
            requirement = Requirement(line)
            (pin,) = requirement.specifier
            assert pin.operator == "=="
            if requirement.marker is None or requirement.marker.evaluate():
                found[canonicalize_name(requirement.name)] = pin.version
    return found


def conda_packages() -> dict[str, SpecifierSet]:
    """Name -> version bounds of environment.yml, without python and pip."""
    document = yaml.safe_load((ROOT / "environment.yml").read_text("utf-8"))
    lines = [line for line in document["dependencies"] if isinstance(line, str)]
    lines += [line for part in document["dependencies"] if isinstance(part, dict) for line in part["pip"]]
    parsed = [re.fullmatch(r"([\w.-]+)(.*)", line).groups() for line in lines]
    return {name: SpecifierSet(bounds) for name, bounds in parsed if name not in ("python", "pip")}


def test_conda_environment_names_the_same_packages_with_the_same_bounds():
    expected = {}
    for requirement in requirements("lab", "train", "cluster", "docs", "dev"):
        expected[CONDA_NAMES.get(canonicalize_name(requirement.name), requirement.name)] = requirement.specifier
    assert conda_packages() == expected


def test_conda_environment_asks_for_the_python_that_the_package_asks_for():
    document = yaml.safe_load((ROOT / "environment.yml").read_text("utf-8"))
    assert f"python{project()['requires-python']}" in document["dependencies"]
    assert document["channels"][0] == "conda-forge"


def test_every_direct_dependency_is_pinned_within_its_bounds():
    versions = pins()
    wrong = [
        str(requirement)
        for requirement in requirements(*project()["optional-dependencies"])
        if not requirement.specifier.contains(versions.get(canonicalize_name(requirement.name), "0"))
    ]
    assert wrong == []


def test_hints_install_extras_from_a_copy_and_by_no_name_on_an_index():
    pages = [ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "notebooks").glob("*")]
    texts = {path: path.read_text("utf-8") for path in (*pages, *(ROOT / "harmolab").rglob("*.py")) if path.is_file()}
    assert [path.name for path, text in texts.items() if re.search(r"\bharmolab\[[a-z]", text)] == []
    named = {extra for text in texts.values() for extra in re.findall(r"pip install '\.\[([a-z0-9]+)\]'", text)}
    assert {"train", "cluster", "c3d"} <= named <= set(project()["optional-dependencies"])


def test_scoring_does_not_depend_on_torch_or_jupyter():
    names = {requirement.name for requirement in requirements()}
    assert names.isdisjoint({"torch", "lightning-fabric", "jupyterlab", "ipywidgets", "dask"})


def test_citation_names_the_software_and_three_papers():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == project()["version"]
    assert [reference["title"].split(":")[0] for reference in citation["references"]] == [
        "Harmony-aware Human Motion Synthesis with Music",
        "Music2Dance",
        "Audio to Body Dynamics",
    ]


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not on this machine")
def test_make_lists_every_promised_target():
    listing = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    targets = set(re.findall(r"^  make (\S+)", listing, flags=re.MULTILINE))
    promised = "setup test test-browser check lint lab report figures docs dist bench clean"
    assert set(promised.split()) <= targets


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not on this machine")
def test_make_says_which_python_is_needed_when_the_one_named_is_missing(tmp_path: Path):
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    result = subprocess.run(["make", "setup", "PYTHON=no-such-python"], cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode != 0
    assert "needs Python 3.11 or later" in result.stderr
