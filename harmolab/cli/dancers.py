"""The dancer that `harmolab dance` asks: a choreographer of a bank or of a corpus, or a trained system."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol, cast, runtime_checkable

import typer

import harmolab
from harmolab import systems
from harmolab.cli.common import Scale, check_untold, completed, dance_names, is_told
from harmolab.cli.screen import note, progress
from harmolab.cli.training import TRAIN_HINT, accepted

if TYPE_CHECKING:
    from harmolab.types import Audio, BeatTrack, Motion

CHOREOGRAPHER, PUPPET = "choreographer", "puppet"
FEWEST_WINDOWS = 6  # of half a minute at most: fewer are no measure of what else is a dance
LOWEST, HIGHEST = 0.8, 2.5  # metres that a dancer may be tall
TOO_FEW = (
    "these recordings are too few to judge a dance by: it was held against recorded ballroom dancers, and what fails "
    "may only be another style"
)
NO_BAR = "no bar of a {dance} is asked for, as this movement has none: the number is that of a score without --dance"
OTHER_DANCE = "these weights did not learn that dance: they dance another one, which is judged as if none was named"
BALLROOM = "ballroom"  # the style of music in threes, and of a dance by name, where neither is left to the caller
SURE_THREES = 0.03  # of `threes`: 35 of 35 recorded waltzes have more, and 4 of 40 songs in 4/4
THREES = "the music seems to go in threes, so ballroom is danced (--style salsa: dance salsa all the same)"
NEAREST = "{bar} beats in a bar are heard, {tempo:.0f} a minute, so {dance}, the nearest, is danced (--dance: another)"
NAMED_OTHERS = 3  # dances that come next, in words; --json has all


@runtime_checkable
class Listener(Protocol):
    """A system that can be asked which dance a song calls for."""

    @property
    def dances(self) -> tuple[str, ...]:
        """Dances that it learnt."""

    def dance_probabilities(self, audio: Audio) -> Mapping[str, float]:
        """Dance -> its probability, the most likely first; ValueError where it cannot tell."""


@dataclass(frozen=True, eq=False)
class Dancer:
    """The one who dances.

    Parameters
    ----------
    system : System
    options : keywords of its `generate` from the command line
    limits : LikenessLimits of its recordings, None for those of the package
    knows_bars : bool, whether its dances have places in the bar that can be judged
    remarks : sentences about it that are printed with every dance
    listener : the system where it is to say which dance the music is, else None
    dance_probabilities : its answer, once it was asked
    in_threes : makes the dancer for music in 3/4; None where that is this one too
    """

    system: systems.System
    options: dict[str, Any]
    limits: harmolab.LikenessLimits | None = None
    knows_bars: bool = True
    remarks: tuple[str, ...] = ()
    listener: Listener | None = None
    dance_probabilities: Mapping[str, float] | None = None
    in_threes: Callable[[], Dancer] | None = None

    def for_music(self, audio: Audio, dance: str, tracks: Callable[[str], BeatTrack]) -> tuple[Dancer, str]:
        """The dancer, and the dance to be danced and judged as: `dance`, or the one that the music calls for.

        `tracks` gives the beats of the music as those of a dance, "" for none in particular.

        Raises
        ------
        ValueError
            If the listener cannot tell.
        """
        if isinstance(self.system, systems.Choreographer) and not dance:
            return self._by_ear(self.system, audio, tracks)
        if self.listener is None:
            return self, dance
        probabilities = self.listener.dance_probabilities(audio)
        likely = next(iter(probabilities))
        name = likely if likely in self.listener.dances else ""
        remarks = (*self.remarks, dance_in_words(probabilities), *([] if name else [OTHER_DANCE]))
        options = self.options | {"dance": name or None}
        return replace(self, options=options, remarks=remarks, dance_probabilities=probabilities), name

    def _by_ear(
        self, choreographer: systems.Choreographer, audio: Audio, tracks: Callable[[str], BeatTrack]
    ) -> tuple[Dancer, str]:
        """The dancer for music in threes, where there is another one; and of several dances the nearest one."""
        from harmolab.beats.meter import threes
        from harmolab.systems.choreographer.takes import nearest_dance

        several = len(choreographer.dances) > 1
        if self.in_threes is None and not several:
            return self, ""
        track = tracks("")
        in_threes = threes(audio, track)
        if self.in_threes is not None and in_threes > SURE_THREES:
            other = self.in_threes()
            return replace(other, remarks=(THREES, *other.remarks)).for_music(audio, "", tracks)
        if not several or not (name := nearest_dance(choreographer.takes, track.tempo, 3 if in_threes > 0 else 4)):
            return self, ""
        said = NEAREST.format(bar="three" if in_threes > 0 else "four", tempo=track.tempo, dance=name)
        return replace(self, options=self.options | {"dance": name}, remarks=(said, *self.remarks)), name

    def dance(self, audio: Audio, beats: BeatTrack, **more: Any) -> tuple[Motion, systems.Choreography | None]:
        """A motion, and what it, or the sketch that it corrects, is made of where that was made of recordings."""
        options = self.options | more
        is_composed = isinstance(self.system, systems.Choreographer) or getattr(self.system, "sketches", None)
        if not is_composed:
            return self.system.generate(audio, beats, **options), None
        choreography: systems.Choreography = cast(Any, self.system).choreograph(audio, beats, **options)
        return choreography.motion, choreography


@dataclass(frozen=True)
class DancerOptions:
    """Options that say who dances, and to what music.

    Parameters
    ----------
    corpus : Dance with your own recordings: a corpus, a folder of npz or BVH files, or one file.
    style : Movement that comes with harmolab: salsa, ballroom (made by a network), indian, or puppet (synthetic).
        Left out: ballroom to music in 3/4 or where --dance is named, else salsa.
    dance : Dance of the music (waltz, ...). It tells the usual tempo, and as which dance the result is judged. Left out
        with --from: of several dances there, the one whose meter and tempo are nearest. With music2dance, --dance ""
        lets its classifier name the dance.
    system : choreographer (default), harmogan or music2dance; with --weights also lee2019, ren2020 or a class of yours
        (module:Class).
    weights : Folder of `harmolab train`, or a weights file; both say which system made them.
    """

    corpus: Annotated[Path | None, typer.Option("--from")] = None
    scale: Scale = None
    style: Annotated[str | None, typer.Option(autocompletion=completed("salsa", "ballroom", "indian", "puppet"))] = None
    dance: Annotated[str, typer.Option(autocompletion=dance_names)] = ""
    system: Annotated[
        str | None,
        typer.Option(autocompletion=completed("choreographer", "harmogan", "lee2019", "music2dance", "ren2020")),
    ] = None
    weights: Path | None = None


def dancer_of(context: typer.Context, options: DancerOptions) -> Dancer:
    """The dancer that the options name; the shipped salsa where they name none.

    Raises
    ------
    ValueError
        For options that exclude each other, or one that this dancer does not take.
    """
    _check_choice(context, options)
    dance, weights, system = options.dance, options.weights, options.system
    if weights is None and system in (None, CHOREOGRAPHER):
        return _choreographer(context, options)
    trained = _trained(weights, system)
    if isinstance(trained, systems.Choreographer):
        return _of_recordings(context, trained)
    if hasattr(trained, "dances"):  # a system of somebody else may know dances without a list
        _check_dance(dance, trained.dances)
    taken = accepted(trained.generate, context, {"progress": progress})
    is_asked = is_told(context, "dance") and not dance  # --dance ""
    listener = trained if is_asked and isinstance(trained, Listener) else None
    knows_bars = getattr(trained, "knows_bars", True)
    remarks = (*getattr(trained, "remarks", ()), *_not_asked(dance, knows_bars=knows_bars))
    if (limits := getattr(trained, "limits", None)) is not None:
        limits, few = _measure(limits)
        remarks += few
    return Dancer(trained, taken, limits, knows_bars, remarks, listener)


def _not_asked(dance: str | None, *, knows_bars: bool) -> tuple[str, ...]:
    """A remark where the bar of a dance could be asked for and the movement knows none."""
    from harmolab.params import DANCE_PATTERNS

    return (NO_BAR.format(dance=dance),) if dance in DANCE_PATTERNS and not knows_bars else ()


def _check_choice(context: typer.Context, options: DancerOptions) -> None:
    """ValueError for options that exclude each other, FileNotFoundError for weights that are not there."""
    corpus, style, system, weights = options.corpus, options.style, options.system, options.weights
    check_untold(context, ("scale",), "is for the files of --from", when=corpus is None)
    if corpus is not None and style is not None:
        raise ValueError("--from and --style exclude each other: leave out your own recordings, or the shipped style")
    other = "--weights" if weights is not None else f"--system {system}"
    reason = f"is for the choreographer, which dances with recorded movement; leave out {other}"
    check_untold(context, ("corpus", "style"), reason, when=weights is not None or system not in (None, CHOREOGRAPHER))
    if weights is not None and not weights.exists():
        from harmolab.systems.training.about import json_file, weights_stem

        if not json_file(weights_stem(weights)).exists():
            raise FileNotFoundError(f"{weights}: no such folder or file of weights")


def _choreographer(context: typer.Context, options: DancerOptions) -> Dancer:
    """The choreographer of a corpus or of a bank; ValueError for a dance that neither it nor the tempo table knows."""
    from harmolab.systems.choreographer.banks import STYLES
    from harmolab.systems.choreographer.generate import load_corpus

    dance, has_ballroom = options.dance, BALLROOM in STYLES
    if options.corpus is not None:
        choreographer = load_corpus(options.corpus, scale=options.scale, progress=progress)
        _check_dance(dance, choreographer.dances)
        return _of_recordings(context, choreographer)
    if options.style is not None or not has_ballroom:
        return _of_bank(context, options.style or "salsa", dance)
    if dance:
        return _of_bank(context, BALLROOM, dance)
    return replace(_of_bank(context, "salsa", ""), in_threes=partial(_of_bank, context, BALLROOM, ""))


def _of_bank(context: typer.Context, style: str, dance: str) -> Dancer:
    """The choreographer of a bank, which says what it is."""
    from harmolab.systems.choreographer.banks import REMARKS, shipped_bank

    choreographer = shipped_bank(style, dance)
    _check_dance(dance, choreographer.dances)
    return _dancer(context, choreographer, None if style == PUPPET else choreographer.limits, REMARKS[style])


def _check_dance(dance: str, learnt: Iterable[str]) -> None:
    """ValueError for a dance that neither these recordings nor the tempo table know."""
    from harmolab.clips import unknown_dance

    if dance and dance not in (dances := {*harmolab.DANCES, *learnt} - {""}):
        raise unknown_dance(dance, dances)


def _of_recordings(context: typer.Context, choreographer: systems.Choreographer) -> Dancer:
    """A choreographer of recordings of one's own, by which its dances are judged if there are enough of them."""
    from harmolab.body.skeletons import standing_height

    for line in choreographer.notes:
        note(f"left out: {line}")
    height = standing_height(choreographer.takes[0].motion.positions)
    if not LOWEST <= height <= HIGHEST:
        note(f"these recordings are of a body {height:.2g} m tall; for other units pass --scale (CMU's BVH: 0.056444)")
    limits, few = _measure(choreographer.limits)
    return _dancer(context, choreographer, limits, *few)


def _measure(limits: harmolab.LikenessLimits | None) -> tuple[harmolab.LikenessLimits | None, tuple[str, ...]]:
    """Limits of recordings that are enough to be a measure; none, and a remark, where they are too few."""
    is_measure = limits is not None and limits.windows >= FEWEST_WINDOWS
    return (limits, ()) if is_measure else (None, (TOO_FEW,))


def _dancer(
    context: typer.Context, choreographer: systems.Choreographer, limits: harmolab.LikenessLimits | None, *remarks: str
) -> Dancer:
    """A choreographer as a dancer; where it knows no bar, it says by what it is not judged."""
    options = accepted(choreographer.generate, context, {"progress": progress})
    knows_bars = any(take.places.size for take in choreographer.takes)
    remarks = (*remarks, *_not_asked(options.get("dance"), knows_bars=knows_bars))
    return Dancer(choreographer, options, limits, knows_bars, remarks)


def _trained(weights: Path | None, system: str | None) -> systems.System:
    """The system in a folder; the weights shipped for it where none are named."""
    from harmolab.systems.contract import PLAYERS, check_dances, maker_of, names

    check_dances(system)
    dancing = [name for name in names() if name not in PLAYERS]
    if weights is None and system not in dancing:
        raise ValueError(f"no weights are shipped for {system!r}: pass --weights RUN, or one of {', '.join(dancing)}")
    if weights is not None:
        check_dances(maker_of(weights), f"{weights}: ")
    shipped = Path(harmolab.__file__).parent / "systems" / (system or "") / "weights"
    if weights is None and not (shipped / "model.safetensors").is_file():
        raise ValueError(
            f"no weights are shipped for --system {system}; train some with "
            f"`harmolab train DATA --system {system} --out RUN` and pass --weights RUN"
        )
    try:
        return systems.load(shipped if weights is None else weights, system=system)
    except ModuleNotFoundError as error:
        raise ValueError(f"{weights or system}: dancing with it needs {error.name}; {TRAIN_HINT}") from None


def dance_in_words(probabilities: Mapping[str, float]) -> str:
    """The dance that a song sounds like, and how likely it and the next ones are.

    >>> dance_in_words({"waltz": 0.62, "cha-cha": 0.2, "rumba": 0.18})
    'the music sounds like a waltz (0.62; cha-cha 0.20, rumba 0.18)'
    """
    (likely, share), *others = probabilities.items()
    named = [f"{name} {value:.2f}" for name, value in others[:NAMED_OTHERS]]
    more = ["..."] if len(others) > len(named) else []
    noun = f"a {likely}" if likely in harmolab.DANCES else repr(likely)
    beside = f"; {', '.join(named + more)}" if others else ""
    return f"the music sounds like {noun} ({share:.2f}{beside})"
