"""`harmolab dance`: a song in, a dance out, and how well it went: likeness to people, seams, fit to the music.

The names of the files are checked before any work.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import harmolab
from harmolab import lab, systems
from harmolab.cli import common
from harmolab.cli.dancers import DancerOptions, dancer_of
from harmolab.cli.screen import finding_beats, is_verbose, note, printable, progress, waiting, wrote
from harmolab.cli.sources import note_tempo
from harmolab.cli.training import TRAIN_HINT
from harmolab.files import plain

if TYPE_CHECKING:
    from harmolab.metrics.likeness import Likeness
    from harmolab.systems.choreographer.generate import Choreography
    from harmolab.types import Audio, BeatTrack, BoolArray, Motion

# Files of a dance: their names, and what is written to each

SUFFIXES = (*common.VIDEOS_OUT, *common.PAGES, ".bvh", ".npz")
UNASKED = (".html", ".mp4", ".bvh")  # where nothing is asked for
LONGEST_NAME = 200  # bytes: file systems take 255, and noun, number and ending are added


def dance_files(out: Path | None, song: Path, seed: int, samples: int) -> dict[int, list[Path]]:
    """Seed -> its files: `out`, or a page, a video and a BVH named after the song in the working folder.

    Raises
    ------
    ValueError
        For a name that cannot be written or is of no kind that is known.
    """
    paths = files_to_write(out, song, "dance", UNASKED)
    if samples == 1:
        return {seed: paths}
    numbers = range(seed, seed + samples)
    return {number: [path.with_name(f"{path.stem}_{number}{path.suffix}") for path in paths] for number in numbers}


def files_to_write(out: Path | None, song: Path, noun: str, unasked: Sequence[str]) -> list[Path]:
    """`out`, or without it files of the `unasked` kinds, named after the song and a noun; errors as `dance_files`."""
    if out is not None:
        common.check_out(out, f"a {noun}", SUFFIXES)
        return [out]
    if len(song.stem.encode()) > LONGEST_NAME:
        raise ValueError(f"{song}: its name is too long to add to; choose one with --out")
    paths = [Path(f"{song.stem}_{noun}{suffix}") for suffix in unasked]
    for path in paths:
        common.check_place(path)
    return paths


def written(paths: Iterable[Path], write: Callable[[Path], None], *, is_asked: bool) -> list[Path]:
    """The paths of files that `write` could write.

    Raises
    ------
    ValueError
        For a file that cannot be made, if it was asked for; else a note says that it is left out, and why.
    """
    done = []
    for path in paths:
        try:
            write(path)
            done.append(path)
        except ValueError as error:
            if is_asked:
                raise
            note(f"left out: {path}: {error}")
    return done


def _write(path: Path, report: DanceReport, sound: Audio, title: str) -> None:
    """Write the kind of file that a name asks for; a page has everything that is known about the dance."""
    suffix = path.suffix.lower()
    if suffix not in (*common.PAGES, *common.VIDEOS_OUT):
        harmolab.save_motion(path, report.motion, offset=report.start)
        return
    part = sound.span(report.start, report.motion.duration)
    if suffix in common.PAGES:
        dancer = lab.Dancer("generated", report.motion, report.score, instead=report.caption)
        facts = report.facts | ({"to note": " ".join(report.notes)} if report.notes else {})
        lab.Player(part, [dancer], music=report.music, title=title, facts=facts).save(path)
    else:
        clip = harmolab.Clip(title, part, report.motion, beats=report.music)
        lab.write_dance(path, clip, score=report.score, progress=progress)


# The report on a dance

NAMED = 6  # recordings that are named on the screen and on the page; the others are counted
ADVICE = "(--"  # begins the option that a remark advises
TEMPO = "danced at about {:.0f} bpm; if you count half or twice as many, give the dance (--dance) or your --beats"
JOINED = (
    *("mean_seam_cm", "worst_seam_cm", "distinct_minutes", "longest_stretch", "seen_before"),
    *("shares", "stretch", "warnings", "pieces", "form"),
)
LIKENESS = ("verdict", "passed", "fails", "values", "recorded")


@dataclass(frozen=True, eq=False)
class DanceReport:
    """A dance and what is known about it.

    Parameters
    ----------
    seed : int that it was made with
    motion : Motion
    start : float, seconds, audio time of its first frame
    music : BeatTrack on the motion's time line
    score : HarmonyScore of both
    likeness : Likeness of the motion
    choreography : Choreography, None where it was not made of recordings
    remarks : sentences about the dancer, and about the music: its tempo, and where that was asked which dance it is
    knows_bars : bool, whether it is of use to be told the dance, or where its bars begin
    dance_probabilities : dance -> how likely the music is one, None where that was not asked
    """

    seed: int
    motion: Motion
    start: float
    music: BeatTrack
    score: harmolab.HarmonyScore
    likeness: Likeness
    choreography: Choreography | None = None
    remarks: tuple[str, ...] = ()
    knows_bars: bool = True
    dance_probabilities: Mapping[str, float] | None = None

    @cached_property
    def has_harmony(self) -> bool:
        """True unless the dance fails by likeness: its harmony would mean nothing."""
        return self.likeness.passed is not False

    @property
    def caption(self) -> str:
        """The words on a dance that does not pass by likeness, whose harmony is not told alone; "" on one that does."""
        return "" if self.likeness.passed else " ".join(self._judged)

    @property
    def verdict(self) -> tuple[str, ...]:
        """Sentences: likeness; harmony, if likeness does not fail; what else there is to say."""
        return (*self._judged, *self.notes)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Sentences that go with the numbers: of the score, the dancer, and the choice of movement."""
        sentences = list(self.remarks)
        if self.has_harmony and self.score.judgement is not None:
            remarks = self.score.judgement.remarks
            sentences = [*(one for one in remarks if self.knows_bars or ADVICE not in one), *sentences]
        if self.choreography is not None:
            sentences += self.choreography.warnings
            sentences += [f"heard: {self.choreography.form}"] if self.choreography.form else []
        return _of_dance(sentences)

    @cached_property
    def _judged(self) -> tuple[str, ...]:
        """Likeness, and harmony where it means something."""
        words, judgement = [self.likeness.verdict], self.score.judgement
        if self.has_harmony and len(self.music) and judgement is not None:
            words.append(judgement.verdict if judgement.beats.is_sure else common.UNSURE)
        return _of_dance(words)

    @cached_property
    def facts(self) -> dict[str, str]:
        """Name -> text of every number, for a table."""
        from harmolab.lab.evaluate.measured import dance_scores

        scores = dance_scores(self.motion, self.music, self.score, likeness=self.likeness) | self._rests()
        return {name: common.show(value) for name, value in scores.items()} | self._pieces()

    def _rests(self) -> dict[str, float]:
        """Share of the beats on which the body rests, above chance; a dance that fails by likeness has none."""
        if not self.has_harmony:
            return {}
        late = {"rests of the body on the beat, above chance": 0.0, "the same half a beat late": 0.5}
        return {name: lab.rests_on_beat(self.motion, self.music, late=beats) for name, beats in late.items()}

    def _pieces(self) -> dict[str, str]:
        """Seams and recordings of a dance that was made of recordings."""
        if (choreography := self.choreography) is None:
            return {}
        return {
            "seams, cm": f"{choreography.mean_seam_cm:.1f} on average, {choreography.worst_seam_cm:.1f} at worst",
            "distinct movement to choose from": f"{choreography.distinct_minutes:.1f} minutes",
            "longest stretch of one recording": f"{choreography.longest_stretch} beats",
            "beats that look like earlier ones": f"{choreography.seen_before:.0%}",
            "made of": folded(choreography.shares),
        }

    def to_dict(self) -> dict[str, Any]:
        """Everything, for JSON; every piece with its place in the dance. What fails by likeness has no harmony."""
        joined = () if self.choreography is None else JOINED
        return {
            "seed": self.seed,
            "start": self.start,
            "seconds": self.motion.duration,
            "likeness": {name: getattr(self.likeness, name) for name in LIKENESS},
            "harmony": self.score.to_dict() if self.has_harmony else None,
            "remarks": self.remarks,
            "dance_probabilities": self.dance_probabilities,
            **{name: getattr(self.choreography, name) for name in joined},
        }


def _of_dance(words: Iterable[str]) -> tuple[str, ...]:
    """Sentences on the dance, said of it."""
    from harmolab.lab.player_data import of_dance

    return tuple(map(sentence, map(of_dance, words)))


def sentence(text: str) -> str:
    """Words with a capital at the start and a full stop at the end."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '?', '!')) else '.'}"


def folded(shares: Mapping[str, float]) -> str:
    """A line that names the recordings that gave most of a dance, and counts the others."""
    lines = [f"{name} {share:.0%}" for name, share in list(shares.items())[:NAMED]]
    more = [f"{len(shares) - NAMED} more (--json names every piece)"] if len(shares) > NAMED else []
    return ", ".join(lines + more)


FARTHEST = 30.0  # centimetres that --harmonise may move a joint
CENTIMETRE = 0.01  # metres
MOST_SEEDS = 4  # that are tried, where none is named, until a dance moves like recorded dancers
MEANINGS = (
    "Moves like people: each number stands beside those of recorded dancers; a number far outside FAILS, and then "
    "harmony means nothing. Harmony above chance: the number of `harmolab score`; 0 is chance, 1 the best moment of "
    "the dance on every beat. The paper's numbers (T_delay 0.25 s) mean little without their chance level."
)


@common.with_options
def dance(
    context: typer.Context,
    song: common.Song,
    out: Path | None = None,
    beats: common.Beats = None,
    one: common.One = None,
    seconds: float | None = None,
    offset: Annotated[float, typer.Option("--offset", "--start")] = 0.0,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    samples: Annotated[int, typer.Option(min=1)] = 1,
    *,
    dancer_options: DancerOptions,
    harmonise: Annotated[float | None, typer.Option(metavar="CM")] = None,
    pattern: common.PatternFile = None,
    plant_feet: bool = True,
    feet: Annotated[str | None, typer.Option(autocompletion=common.completed("planted", "model", "none"))] = None,
    temperature: float | None = None,
    as_json: common.AsJson = False,
) -> None:
    """Dance to a song: recorded movement, chosen beat by beat and laid on the music. No training, no torch.

    **Without any option** it dances salsa (practised without the partner); to music in 3/4 it dances ballroom. It
    writes a page that plays the dance, a video, and a BVH file into the folder you are in, named after the song.

    Then it says whether the dance moves like recorded dancers, and how it goes with the music. The words and the number
    are those of `harmolab score`. With `--verbose` it also says how well the pieces of the dance fit together.

    An npz file keeps the song time at which the dance begins. For other files, the --offset to pass with them is
    printed.

    Example: `harmolab dance song.mp3`

    Example: `harmolab dance song.mp3 --from my_corpus --dance waltz --one 12.4 --out dance.mp4`

    Parameters
    ----------
    out : mp4 or webm (with sound), html (a player), bvh (Blender) or npz. Left out: SONG_dance.html, .mp4 and .bvh in
        this folder.
    seconds : Length of the dance (default: to the end of the song).
    offset : Audio time in seconds at which the dance begins.
    seed : Another seed, another dance. So is, of a choreographer, another --seconds, --offset or --beats. Left out, it
        takes the first seed from 0 to 3 whose dance moves like recorded dancers.
    samples : Number of dances, by as many seeds from --seed on; the files are numbered.
    harmonise : Move each joint by up to so many cm, to fit the beats better (needs torch).
    plant_feet : Keep the foot that carries the body from sliding.
    feet : Correction of the feet in music2dance: planted (default), model (a network that was trained for it), or none.
    temperature : Chance in music2dance: share of the predicted spread that is drawn, 0 to 4 (default: that of its
        training; .3 for the shipped network).
    """
    files = dance_files(out, song, seed, samples)
    for path in (path for paths in files.values() for path in paths):
        common.check_output(context, path)
    _check_harmonise(harmonise)
    dancer, dance = dancer_of(context, dancer_options), dancer_options.dance
    if pattern is not None and not dancer.knows_bars:
        raise ValueError("--pattern: this movement knows no bar that a pattern could judge; leave it out")
    from harmolab.clips import song_beats, tracked_sound
    from harmolab.metrics.likeness import likeness

    sound = harmolab.load_sound(song, sample_rate=None)
    audio = tracked_sound(song, sound)
    with finding_beats():
        dances = harmolab.DANCES
        tracks = cache(lambda name: song_beats(audio, dance=name if name in dances else "", beats=beats, one=one))
        dancer, dance = dancer.for_music(audio, dance, tracks)
        track = tracks(dance)
    note_tempo(song, dance, track)
    params = common.recommended(pattern, dance if dancer.knows_bars else "")

    def danced(number: int) -> DanceReport:
        with waiting("dancing"):
            motion, choreography = dancer.dance(audio, track, start=offset, seconds=seconds, seed=number)
        music = track.span(offset, motion.duration)
        is_open_tempo = not dance and music.quality is not None and len(music) > 1
        tempo = (TEMPO.format(music.tempo),) if is_open_tempo else ()
        held = _silent(motion, audio, track, offset) if choreography is None else choreography.held
        if harmonise is not None:
            sounding, reach = replace(motion, valid=motion.valid & ~held), harmonise * CENTIMETRE
            moved = harmolab.harmonise(sounding, music, reach=reach, params=params, progress=progress)
            motion = replace(moved, valid=motion.valid)
        score = harmolab.score_clip(harmolab.Clip(song.stem, audio, motion, offset, beats=track, dance=dance), params)
        judged = likeness(motion, dance=dance, limits=dancer.limits, held=held)
        return DanceReport(
            number, motion, offset, music, score, judged, choreography, (*dancer.remarks, *tempo),
            knows_bars=dancer.knows_bars, dance_probabilities=dancer.dance_probabilities,
        )  # fmt: skip

    is_quick = isinstance(dancer.system, systems.Choreographer)  # whose dances take a second
    is_open = samples == 1 and is_quick and not common.is_told(context, "seed")
    title = f"A generated dance to {common.plain_name(song)}"
    reports: list[DanceReport] = []
    paths: list[Path] = []
    for number in files:
        reports.append(_likely(danced, number) if is_open else danced(number))
        write = partial(_write, report=reports[-1], sound=sound, title=title)
        paths += written(files[number], write, is_asked=out is not None)
    if offset + (seconds or 0.0) > sound.duration + 0.05:
        note(f"{song} ends at {sound.duration:.1f} s, and so does the dance")
    if len(reports[0].music) < 2:
        note(f"no beats heard in {song} from {offset:g} s on: the scores of this dance mean nothing")
    _print(reports, as_json=as_json)
    wrote(*paths, err=as_json)
    common.say_begin(offset, *paths, err=as_json)


def _likely(danced: Callable[[int], DanceReport], seed: int) -> DanceReport:
    """The dance of the first seed from `seed` on that moves like recorded dancers; that of `seed` where none does."""
    left: list[DanceReport] = []
    for number in range(seed, seed + MOST_SEEDS):
        report = danced(number)
        if report.has_harmony:
            return report
        left.append(report)
        note(f"seed {number} is not used: {report.likeness.verdict}")
    note(f"no seed up to {seed + MOST_SEEDS - 1} does better, so seed {seed} is danced")
    return left[0]


def _silent(motion: Motion, audio: Audio, track: BeatTrack, offset: float) -> BoolArray:
    """The frames of a network's dance in which the music is silent."""
    from harmolab.lab.evaluate.measured import silent_frames

    return silent_frames(motion, audio, track, start=offset)


def _check_harmonise(reach: float | None) -> None:
    """ValueError for a reach that is out of range, or where the library is missing that it needs."""
    if reach is None:
        return
    if not 0 < reach <= FARTHEST:
        raise ValueError(f"--harmonise is a number of centimetres up to {FARTHEST:g}, got {reach:g}")
    if find_spec("torch") is None:
        raise ValueError(f"--harmonise needs torch; {TRAIN_HINT}")


def _print(reports: Sequence[DanceReport], *, as_json: bool) -> None:
    """All that is known of the dances: as JSON, or as sentences and a column of a table each."""
    if as_json:
        typer.echo(json.dumps(plain([report.to_dict() for report in reports]), indent=1))
        return
    for report in reports:
        seed = f"seed {report.seed}: " if report.seed or len(reports) > 1 else ""
        typer.echo("\n  ".join(map(printable, [f"{seed}{report.verdict[0]}", *report.verdict[1:]])))
    common.print_music(reports[0].music)
    if is_verbose():
        facts = {f"seed {report.seed}": report.facts for report in reports}
        names = dict.fromkeys(name for column in facts.values() for name in column)
        rows = ([name, *(column.get(name, "-") for column in facts.values())] for name in names)
        common.print_table(["", *facts], rows, "the dance and its music", MEANINGS)
