"""Systems that dance or play an instrument: what they have in common, how to find one, and how to load one.

A *system* makes dances from music: a class with the methods of `System`. Its name is that of its module here
(``harmogan`` is `harmolab.systems.harmogan`, class `HarmoGAN`); a class outside harmolab is called
``package.module:Class``. Weights name the system that made them, as ``"system"`` in ``model.json``. What such a file
names is never imported from outside this package unless you name it, too.

A system may have parts that are trained by themselves (`PARTS`). They do not dance: the system uses them where they lie
in its run. `PLAYERS` do not dance either: their motions are a musician's points in a picture.
"""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Any, Protocol, Self

from harmolab.files import PathLike
from harmolab.systems.training.about import read_about
from harmolab.types import Audio, BeatTrack, Motion

# Name of a part -> the system that it belongs to; its class stands in the module of its name there.
PARTS: Mapping[str, str] = MappingProxyType({"attributes": "music2dance", "feet": "music2dance"})
# Systems that play an instrument -> the package that each is.
PLAYERS: Mapping[str, str] = MappingProxyType({"audio2body": "harmolab.musician"})


class Trainable(Protocol):
    """The method that systems and their parts have: `train`. It may take more keywords, all with defaults."""

    @classmethod
    def train(cls, data: Sequence[PathLike], out: PathLike, *, seed: int = 1, resume: bool = False, **more: Any) -> Any:
        """Train on corpora (folders of recordings), save the system in a folder, and return it.

        Parameters
        ----------
        data : sequence of str or path
            Folders of recordings.
        out : str or path
            New or empty, unless `resume`, which goes on with the training there.
        seed : int
        resume : bool
        **more
            Keywords of the system. ``report`` (`harmolab.systems.training.checkpoints.Report`) is called after every
            epoch.
        """


class System(Trainable, Protocol):
    """A system that makes dances from music: the methods that all systems have, `generate`, `save`, `load` and `train`.

    Each may take more keywords than these, all with defaults. A class of your own with these methods is a system, too:
    its name is ``package.module:Class``, and harmolab's commands train it and let it dance by this name.
    """

    def generate(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        start: float = 0.0,
        seconds: float | None = None,
        seed: int = 0,
        initial: Motion | None = None,
    ) -> Motion:
        """Dance to music: a motion whose first frame stands at second `start` of the music.

        Parameters
        ----------
        audio : Audio
            The whole recording.
        beats : BeatTrack
            Beats on the audio's time line; a program finds them when left out.
        start : float, seconds
            Moment of the music at which the dance begins.
        seconds : float
            Length of the dance; to the end of the music when left out or longer.
        seed : int
            The same seed gives the same dance.
        initial : Motion
            Movement that the dance goes on from, in pose if not in place; drawn by `seed` when left out.

        Returns
        -------
        Motion

        Raises
        ------
        ValueError
            If `start` or `seconds` lies outside the music, or `initial` is of another skeleton.
        """

    def save(self, folder: PathLike) -> None:
        """Write the system to a folder, which is made if there is none: weights, and ``model.json``.

        The latter has ``{"format": 1, "system": "package.module:Class", "build": {}}`` at least. "build" is for all
        that the class needs to be built again.
        """

    @classmethod
    def load(cls, folder: PathLike) -> Self:
        """The system that was saved in a folder; ValueError or FileNotFoundError names the file at fault."""


def names() -> list[str]:
    """Names of the systems that come with harmolab, sorted; `find` takes them."""
    packages = (module.name for module in iter_modules([str(Path(__file__).parent)]) if module.ispkg)
    return sorted({*packages, *PLAYERS} - {"training"})


def find(name: str) -> type[System]:
    """The class of a system by its name.

    Parameters
    ----------
    name : str
        One of `names`, such as "harmogan", or "package.module:Class" for a system of your own, which is then imported.

    Returns
    -------
    A class with the methods of `System`

    Raises
    ------
    ValueError
        If there is no such system, it is a part of one, or the class lacks a method of `System`.

    Examples
    --------
    >>> find("choreographer").__name__
    'Choreographer'
    """
    check_whole(name)
    module, outside, _ = str(name).partition(":")
    if not outside and name not in names():
        raise ValueError(f"unknown system {name!r}; there are {', '.join(names())}, and others as package.module:Class")
    system: type[System] = _class(name, module if outside else PLAYERS.get(name, f"{__package__}.{name}"))
    if missing := [method for method in ("generate", "save", "load", "train") if not hasattr(system, method)]:
        raise ValueError(f"system {name}: the class has no {', '.join(missing)}; see harmolab.systems.System")
    return system


def trainable(name: str) -> type[Trainable]:
    """The class of a system, as `find`, or of a part of one."""
    return _class(name, f"{__package__}.{PARTS[name]}.{name}") if name in PARTS else find(name)


def check_whole(name: str | None, place: str = "") -> None:
    """ValueError that begins with `place` where a name is that of a part, which does not dance by itself."""
    if whole := PARTS.get(name or ""):
        raise ValueError(
            f"{place}{name} is a part of {whole}, not a dancer: train it into a run of {whole} "
            f"(--out RUN/{name}) and dance with --weights RUN"
        )


def check_dances(name: str | None, place: str = "") -> None:
    """ValueError that begins with `place` where a name is that of a part, or of a system that plays an instrument."""
    check_whole(name, place)
    if name in PLAYERS:
        raise ValueError(f"{place}{name} plays, it does not dance: use `harmolab perform SONG`")


def _class(name: str, module: str) -> Any:
    """The class that a name means in a module; ValueError where there is none."""
    _, outside, class_name = name.partition(":")
    try:
        content = import_module(module)
    except ModuleNotFoundError as error:
        if not outside or error.name != module.partition(".")[0]:
            raise
        raise ValueError(f"system {name}: there is no module {module}; put its folder on PYTHONPATH") from None
    for key in dir(content):
        is_meant = key == class_name if outside else key.lower() == name
        if is_meant and isinstance(value := getattr(content, key), type):
            return value
    raise ValueError(f"system {name}: {module} has no class {class_name or name}")


def load(folder: PathLike, *, system: str | None = None) -> System:
    """The trained system in a folder, ready to dance; its weights say which system they are of.

    Parameters
    ----------
    folder : str or path
        Of a training, or a weights file in it.
    system : str, optional
        Name of the system, as for `find`. Needed for one of your own, since code is not imported because a file says
        so; else it is checked.

    Returns
    -------
    System

    Raises
    ------
    FileNotFoundError, ValueError
        If there are no weights, they are damaged, or another system made them; they name the file or folder.

    Examples
    --------
    >>> motion = load("run").generate(audio, seconds=20.0, seed=3)  # doctest: +SKIP
    """
    maker = maker_of(folder)
    check_whole(maker, f"{folder}: ")
    if system is not None and system != maker:
        raise ValueError(f"{folder}: was made by the system {maker!r}, not by {system!r}")
    if system is None and ":" in maker:
        raise ValueError(
            f"{folder}: was made by {maker}, a class outside harmolab; code is not imported because a file says so. "
            f"If you trust it, name it: --system {maker}, or load(folder, system={maker!r})"
        )
    if system is None and maker not in names():
        raise ValueError(f"{folder}: was made by the system {maker!r}, which this version of harmolab does not have")
    return find(maker).load(folder)


def maker_of(folder: PathLike) -> str:
    """Name of the system that made the weights in a folder, as they say; errors as of `load`."""
    about = read_about(folder)
    if about.get("class") == "PoseNet":
        raise ValueError(f"{folder}: a network that trainings are measured by, no dancer; name the folder of the run")
    return str(about.get("system") or "")
