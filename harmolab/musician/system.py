"""The system: from the sound of an instrument to the points of the musician, trained or shipped."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from harmolab.data.oddities import Oddity, motion_oddities, sound_oddities, training_lines
from harmolab.files import PathLike
from harmolab.musician.cleaning import SHOULDERS
from harmolab.musician.networks import SoundToPoints, synthesize_performance
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.performances import (
    ABOUT,
    Performance,
    find_performances,
    load_performance,
    performance_files,
    split_by_piece,
)
from harmolab.musician.sequences import NO_NOTES, NO_SOUND, PlayedSplit, played_set
from harmolab.readers.player_points import INSTRUMENTS
from harmolab.systems.training.about import DEFAULT_STEM, read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.features import check_choice
from harmolab.systems.training.network_system import Learner, changed
from harmolab.systems.training.requests import DanceRequest
from harmolab.systems.training.splits import SIDES
from harmolab.systems.training.weights import load_weights, save_weights
from harmolab.types import Audio, BeatTrack, Motion, Notes

HELD_OUT = 1 / 6  # of the seconds of performances, for each side that is held out
SYNTHETIC = "synthetic"
PRESETS = ("recommended", "tables", "section_4")
WEIGHTS = Path(__file__).parent / "weights"


class Audio2Body(Learner):
    """Audio to Body Dynamics: a pianist or violinist whose movement a network makes of the sound alone.

    Its motions are points of the musician in a picture, from which an avatar can be drawn (`performed`). Take
    `Audio2Body.shipped`, or train one on your own performances (`Audio2Body.train`).

    Parameters
    ----------
    network : SoundToPoints
        Trained.
    meta : JSON-able mapping
        About its training; kept with the weights.
    """

    def __init__(self, network: SoundToPoints, meta: Mapping[str, Any] | None = None) -> None:
        self.network, self.meta = network, dict(meta or {})

    @property
    def trained_on(self) -> str:
        """A sentence about the players that it was trained on; it stands on everything that the network makes."""
        source = str(self.meta.get("source", ""))
        names = f": {source[:200]}" if source != SYNTHETIC else " planted, synthetic players only"
        training = f"trained on{names}" if source else "nothing says on whom it was trained"
        return f"A network's movement, not a recording; {training}."

    def generate(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        start: float = 0.0,
        seconds: float | None = None,
        seed: int = 0,
        initial: Motion | None = None,
        notes: Notes | None = None,
    ) -> Motion:
        """The points of the musician to a sound.

        Everything follows from the sound: `beats`, `seed` and `initial` are checked, as all systems take them, and
        change nothing.

        Parameters
        ----------
        audio : Audio
            The whole recording.
        start : float, seconds
            Moment of the audio at which the first frame stands.
        seconds : float
            Length of the motion; to the end of the audio when left out or longer.
        notes : Notes, optional
            Of the recording, for a network that hears notes in place of the sound.

        Returns
        -------
        Motion, (T, P, 2) pixels, y down
        """
        DanceRequest(audio, beats, start, seconds, seed, initial)  # an error for what is no sound, number or motion
        if initial is not None and initial.skeleton != self.network.skeleton:
            raise ValueError(f"initial has other joints than this {self.network.instrument} player")
        return synthesize_performance(self.network, audio, start=start, seconds=seconds, notes=notes)

    @classmethod
    def files(cls, root: PathLike) -> list[Path]:
        """The files below a folder that a training would read; those of a folder of frames one by one."""
        files: list[Path] = []
        for folder in find_performances(root).folders:
            own = performance_files(folder)
            for path in filter(None, (folder / ABOUT, own.sound, own.notes, *own.points)):
                files += path.glob("*.json") if path.is_dir() else [path]
        return [file for file in files if file.is_file()]

    def save(self, folder: PathLike) -> None:
        """Write the weights to a folder; it is made unless it exists."""
        Path(folder).mkdir(parents=True, exist_ok=True)
        save_weights(Path(folder) / DEFAULT_STEM, self.network, self.meta)

    @classmethod
    def load(cls, folder: PathLike) -> Self:
        """The system in the folder of a run, or of a weights file; errors name the file."""
        return cls(load_weights(folder, SoundToPoints), read_about(folder)["meta"])

    @classmethod
    def shipped(cls, instrument: str) -> Self:
        """The pianist or violinist that comes with harmolab, trained on planted (synthetic) players only.

        Raises
        ------
        ValueError
            For another instrument.
        """
        check_choice("instrument", instrument, INSTRUMENTS)
        return cls.load(WEIGHTS / instrument)

    @classmethod
    def learn(
        cls,
        data: list[PathLike],
        options: TrainOptions,
        *,
        preset: str = PRESETS[0],
        instrument: str | None = None,
        fps: float | None = None,
        split_seed: int = 0,
        **changes: Any,
    ) -> None:
        """Train on folders of performances of one instrument; `train` calls it, and takes these keywords.

        Parameters
        ----------
        preset : "recommended", "tables" or "section_4"
            "tables" has the settings in the captions of the paper's Tables 1 and 2, "section_4" those of its Section 4.
        instrument, fps : "piano" or "violin", and frames per second
            Of performances whose folders do not say it.
        split_seed : int
            Of the split into training, validation and test by piece.
        **changes
            Other values for fields of `harmolab.musician.params.Audio2BodyParams`, such as ``seed``.
        """
        from harmolab.musician.train import train_audio2body

        check_choice("preset", preset, PRESETS)
        hears_sound = changes.get("hears", "sound") == "sound"
        performances = _performances(data, instrument, fps, hears_sound, options)
        params = changed(getattr(Audio2BodyParams, preset)(performances[0].instrument), changes)
        split = piece_split(performances, params, seed=split_seed)
        options.notice(", ".join(["units: performances", *(f"{len(getattr(split, side))} {side}" for side in SIDES)]))
        train_audio2body(played_set(performances, params, split, progress=options.progress), split, options)


def _performances(
    data: Sequence[PathLike], instrument: str | None, fps: float | None, hears_sound: bool, options: TrainOptions
) -> list[Performance]:
    """All performances in folders, named by their paths; notices tell of those that are left out, or odd."""
    performances: list[Performance] = []
    left_out: list[str] = []
    odd: dict[Path, list[Oddity]] = {}
    named: dict[str, Path] = {}
    for root in map(Path, data):
        folders, problems = find_performances(root)
        left_out += [problem.message for problem in problems]
        for folder in options.progress(folders, "loading performances"):
            name = Path(root.resolve().name, folder.relative_to(root)).as_posix()
            if not (first := named.setdefault(name, folder)).samefile(folder):
                raise ValueError(f"{folder}: is called {name}, as {first} is; rename a folder, so that names differ")
            if first is not folder:  # of a root that was named twice
                continue
            try:
                own = load_performance(folder, instrument=instrument, fps=fps)
                if (own.audio if hears_sound else own.notes) is None:
                    raise ValueError(f"{folder}: {NO_SOUND if hears_sound else NO_NOTES}")
            except (ValueError, FileNotFoundError) as error:
                left_out.append(str(error))
                continue
            sound = [] if own.audio is None else sound_oddities(own.audio)
            odd[folder] = [*sound, *motion_oddities(own.motion)]
            performances.append(replace(own, name=name))
    for line in (*(f"left out: {reason}" for reason in left_out), *training_lines(odd)):
        options.notice(line)
    if not performances:
        reason = left_out[0] if left_out else "there is none"
        raise ValueError(f"no performance to train on below {', '.join(map(str, data))}: {reason}")
    return _of_shared_points(performances, options)


def _of_shared_points(performances: list[Performance], options: TrainOptions) -> list[Performance]:
    """Performances with the points that all have, if shoulders are among them; a notice for each that lacks some."""
    every = dict.fromkeys(itertools.chain(*(each.motion.skeleton.joints for each in performances)))
    missing = {each.name: [name for name in every if name not in each.motion.skeleton.joints] for each in performances}
    shared = [name for name in every if not any(name in lacking for lacking in missing.values())]
    if len(shared) == len(every) or not set(SHOULDERS) <= set(shared):
        return performances
    for name, lacking in missing.items():
        if lacking:
            options.notice(f"left out of all performances, since {name} does not show them: {', '.join(lacking)}")
    return [each.part(shared) for each in performances]


def piece_split(performances: Sequence[Performance], params: Audio2BodyParams, *, seed: int = 0) -> PlayedSplit:
    """Names of performances by side: a sixth of the pieces tested on, and one validated on where `params` says so."""
    share = HELD_OUT if params.validation == "pieces" else 0.0
    return PlayedSplit.of(split_by_piece(performances, test_share=HELD_OUT, validation_share=share, seed=seed))
