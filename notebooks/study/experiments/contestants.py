"""All who are compared: recorded movement, pieces of it, the choreographer, and trained systems, each by the same door.

A row of the tables is a name in `ROWS` and a function that answers a contest, and the number of a training, with a
`Contestant`. Nothing here knows how a system works inside.
"""

import hashlib
import json
import platform
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from harmolab.files import Arrays, cached_arrays, keep_arrays, plain
from harmolab.metrics.likeness import LikenessLimits
from harmolab.params import DANCES
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.harmogan.system import HarmoGAN
from harmolab.systems.lee2019.networks import BEAT
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.layers import parameter_count
from harmolab.types import BeatTrack, Motion
from study.experiments.contests import BASELINES, DRAWN, Baseline, Contest, Excerpt, contests
from study.experiments.generation import VARIANTS, Asked, TrainedSystem, generator_corpora, trained
from study.experiments.music2dance import DANCER_SETTINGS, trained_dancer
from study.experiments.rivals import lee2019, ren2020
from study.profile import RunProfile

LEE_FPS = FeatureParams.paper().fps
Beats = Callable[[Excerpt], BeatTrack]
LEE, LEE_UNWARPED, REN = "Lee et al. 2019", "Lee et al. 2019, without warper", "Ren et al. 2020"
RIGHT_SONG, CHOREOGRAPHER, BANK = "recorded, right song", "choreographer", "choreographer, shipped bank"
METERS = "only where a meter begins"
M2D_PAPER, M2D_CALM, M2D = "Music2Dance", "Music2Dance, calm", "Music2Dance, recommended"
M2D_LSTM, M2D_LSTM_CALM = "Music2Dance's LSTM", "Music2Dance's LSTM, calm"
HARMOGAN, WITHOUT, RECOMMENDED = "HarmoGAN", "HarmoGAN without L_harmo", "HarmoGAN, recommended loss"


@dataclass(frozen=True, eq=False)
class Contestant:
    """A dancer, ready to dance.

    Parameters
    ----------
    dance : function of an excerpt and a seed; frame 0 of the motion belongs to the excerpt's start
    identity : str, all that its dances depend on beside the excerpt and the seed: names what is kept of them
    parameters : float, millions, of what generates; 0 for none
    minutes : float, of training; NaN where none were counted
    entry : entry test -> value, range asked for, passed; what fails one was not trained well enough to be compared
    limits : LikenessLimits of its own recordings, where those of the contest's corpus do not fit it
    """

    dance: Callable[[Excerpt, int], Motion]
    identity: str
    parameters: float = 0.0
    minutes: float = 0.0
    entry: Asked = field(default_factory=dict)
    limits: LikenessLimits | None = None

    @property
    def failed(self) -> tuple[str, ...]:
        """The entry tests that it fails."""
        return tuple(name for name, (_, _, passed) in self.entry.items() if not passed)


@dataclass(frozen=True)
class Row:
    """A row of the tables.

    Parameters
    ----------
    make : function of a contest and the number of a training, from 1, to a Contestant
    kind : "recorded", "pieces", "choreographer" or "network"
    told_beats : str, "yes", "no", or how
    printed : str, name of the row of the paper's tables; "" for none
    draws : bool, whether another seed is another dance
    rival : bool, whether it is a system of other authors, which is trained on the first corpus alone
    repeats : the field of the profile that says how often it is trained at most; "" for as often as the contest says
    """

    make: Callable[[Contest, int], Contestant]
    kind: str
    told_beats: str
    printed: str = ""
    draws: bool = True
    rival: bool = False
    repeats: str = ""

    @property
    def is_trained(self) -> bool:
        """True if there is a contestant for each training."""
        return self.kind == "network"

    def contestants(self, contest: Contest) -> tuple[Contestant, ...]:
        """One for each training in a contest; one where nothing is trained."""
        last = min(contest.trainings, getattr(contest.profile, self.repeats)) if self.repeats else contest.trainings
        return tuple(self.make(contest, training) for training in range(1, (last if self.is_trained else 1) + 1))


def of_system(
    system: Any,
    identity: str,
    *,
    beats: Beats = lambda excerpt: excerpt.beats,
    dances: Collection[str] = DANCES,
    **facts: Any,
) -> Contestant:
    """A system as a contestant, told the name of a dance that is among `dances`.

    `beats` are those of the song that it is told; `facts` as in `Contestant`.
    """

    def dance(excerpt: Excerpt, seed: int) -> Motion:
        name = excerpt.clip.dance if excerpt.clip.dance in dances else ""
        return system.generate(
            excerpt.clip.audio, beats(excerpt), start=excerpt.start, seconds=excerpt.seconds, seed=seed, dance=name
        )

    return Contestant(dance, identity, **facts)


def _baseline(name: str, baseline: Baseline, contest: Contest, training: int) -> Contestant:
    """A dance without training, of the contest's material."""

    def dance(excerpt: Excerpt, seed: int) -> Motion:
        return baseline(contest.material, excerpt, np.random.default_rng([seed, _number(excerpt.name)]))

    return Contestant(dance, _digest(name, contest.split.to_dict(), [one.name for one in contest.dancers]))


def _choreographer(contest: Contest, training: int) -> Contestant:
    """A choreographer of the stretches of recordings that networks were trained on."""
    system = Choreographer.of(contest.teachers)
    takes = [take.name for take in system.takes]
    return of_system(system, _digest(CHOREOGRAPHER, plain(system.params), takes, contest.split.to_dict()))


def _bank(contest: Contest, training: int) -> Contestant:
    """The choreographer of the movement that comes with harmolab, whatever the contest's corpus; it dances salsa."""
    bank = shipped_bank()
    identity = _digest(BANK, plain(bank.params), [take.name for take in bank.takes])
    return of_system(bank, identity, dances=(), limits=bank.limits)


def _harmogan(variant: str, contest: Contest, training: int) -> Contestant:
    """HarmoGAN trained with the losses of a variant of `generation`."""
    run = trained(contest.profile, contest.corpus, VARIANTS[variant], training)
    system, parameters = HarmoGAN.load(run.folder), run.generator.parameter_count() / 1e6
    return of_system(system, run.folder.name, parameters=parameters, minutes=run.minutes)


def _of_run(run: TrainedSystem, parameters: int, identity: str, **facts: Any) -> Contestant:
    """A trained system, with the number of parameters of what generates, its minutes and entry tests."""
    return of_system(run.system, identity, parameters=parameters / 1e6, minutes=run.minutes, entry=run.entry, **facts)


def _lee(warped: bool, contest: Contest, training: int) -> Contestant:
    """Lee et al. 2019; without its warper its units follow each other at their own tempo, whatever the song's beats."""
    run = lee2019(contest.profile, contest.corpus, training)
    beats = {} if warped else {"beats": own_tempo}
    return _of_run(run, run.system.generator.parameter_count(), f"{run.folder.name} {warped}", **beats)


def own_tempo(excerpt: Excerpt) -> BeatTrack:
    """Beats at the tempo that Lee's units are coded in, from the start of the song on: its warper then does nothing."""
    times = np.arange(0.0, excerpt.clip.audio.duration, BEAT / LEE_FPS)
    return BeatTrack(times, np.ones(times.size), LEE_FPS, excerpt.clip.audio.duration)


def _ren(contest: Contest, training: int) -> Contestant:
    run = ren2020(contest.profile, contest.corpus, training)
    return _of_run(run, parameter_count(run.system.generator), run.folder.name)


def _music2dance(settings: str, contest: Contest, training: int) -> Contestant:
    run = trained_dancer(contest.profile, contest.corpus, DANCER_SETTINGS[settings], training)
    network = run.system.generator
    return _of_run(run, network.parameter_count(), _digest(run.folder.name, plain(network.params)))


def _number(name: str) -> int:
    """A number that belongs to a name, the same everywhere."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")


def _digest(*settings: Any) -> str:
    return hashlib.sha256(json.dumps(plain(list(settings)), sort_keys=True).encode()).hexdigest()[:16]


def _cheap(name: str) -> Row:
    kind = "pieces" if "pieces" in name or name.startswith("nearest") else "recorded"
    beats = "no" if name in ("recorded, right song", "recorded, another song") else "yes"
    return Row(partial(_baseline, name, BASELINES[name]), kind, beats, draws=name in DRAWN)


def _music2dance_row(settings: str, *, repeats: str = "n_dancers") -> Row:
    beats = "yes: its features have them"
    return Row(partial(_music2dance, settings), "network", beats, rival=True, repeats=repeats)


ROWS: Mapping[str, Row] = {
    **{name: _cheap(name) for name in BASELINES},
    LEE_UNWARPED: Row(partial(_lee, False), "network", "no", rival=True, repeats="n_rivals"),
    LEE: Row(partial(_lee, True), "network", "yes, by its warper", "Lee", rival=True, repeats="n_rivals"),
    REN: Row(_ren, "network", "no", "Ren", rival=True, repeats="n_rivals"),
    M2D_LSTM: _music2dance_row("paper, LSTM", repeats="n_rivals"),
    M2D_PAPER: _music2dance_row("paper"),
    M2D: _music2dance_row("recommended"),
    WITHOUT: Row(partial(_harmogan, "paper, without"), "network", METERS, WITHOUT),
    HARMOGAN: Row(partial(_harmogan, "paper"), "network", METERS, HARMOGAN),
    RECOMMENDED: Row(partial(_harmogan, "recommended"), "network", "yes: its sketch lies on them"),
    CHOREOGRAPHER: Row(_choreographer, "choreographer", "yes"),
    BANK: Row(_bank, "choreographer", "yes"),
}

# With those that draw a tenth of the predicted spread, which are no systems of their own.
EVERY_ROW: Mapping[str, Row] = {
    **ROWS,
    M2D_CALM: _music2dance_row("paper, calm"),
    M2D_LSTM_CALM: _music2dance_row("paper, LSTM, calm", repeats="n_rivals"),
}


def applies(name: str, contest: Contest) -> bool:
    """True if a contest has such a row.

    To songs of another corpus there are no recorded dancers; rivals, which take an hour each, are trained on the first
    corpus alone.
    """
    if ROWS[name].rival:
        return contest.corpus == generator_corpora(contest.profile)[0]
    return name != RIGHT_SONG or contest.has_own_dancers


class Entry(NamedTuple):
    """A row of a contest with its contestants, one a training; one for a row without trainings."""

    contest: Contest
    name: str
    contestants: tuple[Contestant, ...]

    @property
    def failed(self) -> tuple[str, ...]:
        """The entry tests that any training fails; with one, there are no numbers."""
        return tuple(dict.fromkeys(name for one in self.contestants for name in one.failed))


def entries(profile: RunProfile, rows: Iterable[str] = tuple(ROWS), *, trainings: int | None = None) -> list[Entry]:
    """Every row of every contest of a profile, in this order, trained now unless before.

    Parameters
    ----------
    profile : RunProfile
    rows : names in `ROWS`
    trainings : int, of each network, of Lee and Ren at most `RunProfile.n_rivals`; the profile's when left out. With 0
        there are no networks, nor a pose network
    """
    every = contests(profile, profile.n_seeds if trainings is None else trainings)
    names = [name for name in rows if trainings != 0 or not ROWS[name].is_trained]
    pairs = [(contest, name) for contest in every for name in names if applies(name, contest)]
    return [Entry(contest, name, ROWS[name].contestants(contest)) for contest, name in pairs]


# Their dances, kept under all that they depend on: a comparison that was killed goes on where it was

VERSION = 1  # of what is kept

# Numbers, or arrays of one length, of a motion danced to an excerpt: frame 0 belongs to the excerpt's start.
Measure = Callable[[Motion, Excerpt], Mapping[str, Any]]


def measured(
    kind: str,
    contest: Contest,
    name: str,
    contestant: Contestant,
    songs: Sequence[Excerpt],
    measure: Measure,
    *,
    draws: int = 1,
    settings: Any = None,
) -> pd.DataFrame:
    """A contestant's dances to some songs, each danced `draws` times; measured now unless they were before.

    Parameters
    ----------
    kind : str, of the table
    contest, name, contestant : what is kept is theirs; `name` is that of the row
    songs : Excerpts
    measure : function of a motion and its excerpt to numbers by name; an array is one entry of the table
    draws : int; the seeds are 1 to this
    settings : all that the measures depend on besides, as JSON holds it

    Returns
    -------
    DataFrame, a row a dance, with the columns song, clip, dance, draw, and those of `measure`
    """
    tables = []
    for dance in dict.fromkeys(song.clip.dance for song in songs):
        own = [song for song in songs if song.clip.dance == dance]
        pairs = [(song, draw) for song in own for draw in range(1, draws + 1)]
        key = kept_name(kind, contest, name, contestant, own, {"draws": draws, "settings": settings})
        arrays = cached_arrays(key)
        if arrays is None:
            arrays = _stacked([measure(contestant.dance(song, draw), song) for song, draw in pairs])
            keep_arrays(key, arrays)
        about = [{"song": song.song, "clip": song.name, "dance": dance, "draw": draw} for song, draw in pairs]
        tables.append(pd.DataFrame(about).assign(**{each: list(values) for each, values in arrays.items()}))
    return pd.concat(tables, ignore_index=True)


def _stacked(rows: Sequence[Mapping[str, Any]]) -> Arrays:
    """Each number of all rows in one array; of arrays that differ in length, the ends are left out."""
    columns = {name: [np.asarray(row[name], np.float64) for row in rows] for name in rows[0]}
    return {
        name: np.array([value[: min(map(len, values))] if value.ndim else value for value in values])
        for name, values in columns.items()
    }


def kept(key: str, names: Iterable[str], measure: Callable[[], Arrays]) -> Arrays:
    """The arrays of some names that were kept under a key; measured and kept now unless they were."""
    arrays = cached_arrays(key)
    if arrays is None or set(arrays) != set(names):
        arrays = measure()
        keep_arrays(key, arrays)
    return arrays


def kept_name(
    kind: str, contest: Contest, name: str, contestant: Contestant, excerpts: Sequence[Excerpt], more: Any
) -> str:
    """Name of what is kept: a hash of all that it depends on."""
    songs = [[one.name, one.seconds, _sound_of(one)] for one in excerpts]
    about = [VERSION, kind, contest.about, name, contestant.identity, songs, more]
    return f"compared-{hashlib.sha256(json.dumps(plain(about), sort_keys=True).encode()).hexdigest()[:32]}"


def _sound_of(excerpt: Excerpt) -> str:
    """A hash of a song and its beats."""
    digest = hashlib.sha256(excerpt.clip.audio.samples.tobytes())
    digest.update(excerpt.beats.times.tobytes())
    return digest.hexdigest()


def processor() -> str:
    """Name of this machine's processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text("utf-8").splitlines() if info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
