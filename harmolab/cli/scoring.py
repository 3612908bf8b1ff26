"""`harmolab score`: one motion against its music, with `--why` in words and on a page; or a folder of recordings.

Of a folder each recording is a row; a fault in one is its row.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer

import harmolab
from harmolab import __version__, lab, musician
from harmolab.cli import common
from harmolab.cli.common import FileOptions, JudgeOptions, check_untold, is_told
from harmolab.cli.screen import is_verbose, note, printable, progress, waiting, wrote
from harmolab.cli.sources import Sources, check_signs, clip_of, dance_performance, music_remarks, note_tempo, sources
from harmolab.files import write_text

if TYPE_CHECKING:
    from harmolab.lab.explain.performance import OwnDance
    from harmolab.musician.explain import ExplainedPlaying
    from harmolab.score import HarmonyScore

# `--why`: how a dance, or a musician's hands, go with the sound

FOR_DANCES = ("guess", "search", "dance", "beats", "one", "pattern", "how", "scale", "joints", "smpl", "up")
WITHOUT_PAGE = ("seconds", "mode", "lag", "clock", "csv", "plot", "others")  # options of a score that no page has
WITH_PAGE = ("guess", "search", "instrument")


@dataclass(frozen=True)
class PageOptions:
    """Options of the page that says why.

    Parameters
    ----------
    why : Also write a page, .html, that shows why: pictures, beats, player. Where the dance begins in the song is then
        found by the sound of a video. Without that sound it is found by the movement, but only up to whole beats: then
        nothing is said about the place in the beat.
    guess : With --why: second of the song near which the dance begins, where only the movement can tell (default: 0).
    search : With --why: seconds to search on either side of the guess.
    instrument : With --why: DANCE is a musician's playing, key points of body and hands, or the folder of a
        performance: do the hands meet the notes?
    """

    why: Path | None = None
    guess: float | None = None
    search: float = 2.0
    instrument: Annotated[Literal["piano", "violin"] | None, typer.Option(show_default=False)] = None


def check_options(context: typer.Context, page: PageOptions, mode: str) -> None:
    """ValueError for an option that goes without a page only, or with one only, or that another one makes void."""
    check_untold(context, WITH_PAGE, "goes with --why PAGE.html only", when=page.why is None)
    check_untold(context, WITHOUT_PAGE, "goes without --why", when=page.why is not None)
    check_untold(context, ("guess", "search"), "is of no use where --offset says it", when=is_told(context, "offset"))
    check_untold(context, ("how", "pattern"), "is not for --mode paper, whose settings are fixed", when=mode == "paper")


def explain(
    context: typer.Context,
    out: Path,
    song: Path,
    motion: Path | None,
    page: PageOptions,
    judged: JudgeOptions,
    read: FileOptions,
    *,
    offset: float | None,
    as_json: bool,
) -> None:
    """Write the page `out` that says how a dance, or a playing, goes with its song, and print its first lines."""
    common.check_out(out, "the page", common.PAGES)
    result: OwnDance | ExplainedPlaying
    if page.instrument is None:
        files, place = sources(context, song, motion, judged), {"guess": page.guess, "search": page.search}
        result = _dance(files, judged.params(files.dance), read, offset=offset, **place)
        lab.save_page(out, result)
    else:
        result = _playing(context, song, motion, page.instrument, offset=offset, fps=read.fps)
        musician.save_playing_page(out, result)
    if as_json:
        typer.echo(json.dumps({**result.to_dict(), "version": __version__}, indent=2))
    else:
        typer.echo("\n".join([*result.summary, *(result.details if is_verbose() else ())]))
    wrote(out, err=as_json)


def _dance(files: Sources, params: harmolab.HarmonyParams, read: FileOptions, **place: Any) -> OwnDance:
    """A dance beside its song; `place` are offset, guess and search of `explain_performance`."""
    performance = dance_performance(files, **read.keywords)
    with waiting("listening"):
        result = lab.explain_performance(
            files.song, performance, beats=files.beats, one=files.one, dance=files.dance, params=params, **place
        )
    until = result.skipped + result.motion.duration
    for remark in music_remarks(result.skipped, until, performance.motion.duration, files.song):
        note(remark)
    note_tempo(files.song, files.dance, result.music)
    return result


def _playing(
    context: typer.Context, song: Path, points: Path | None, instrument: str, **options: Any
) -> ExplainedPlaying:
    """A musician's hands beside the sound; options as of `load_playing`."""
    from harmolab.musician.performances import load_playing

    if points is None:
        raise ValueError(f"{song}: --instrument takes SONG and the playing, key points or the folder of a performance")
    check_untold(context, FOR_DANCES, "is for dances; leave it out with --instrument")
    with waiting("listening"):
        audio = harmolab.load_sound(song, sample_rate=None)
        return musician.explain_playing(load_playing(points, audio, instrument=instrument, film=song, **options))


# A folder of recordings, a row each

ScoredRecording = Callable[[Sources], Mapping[str, "HarmonyScore"]]

FOR_ONE = ("offset", "beats", "one", "plot", "others")  # options that mean something for one recording only
LONGEST_PLOT = 600.0  # seconds: forty rows; an hour of them took over half an hour
JUDGED = ("level", "verdict", "p_time", "p_place", "lag_s", "tempo", "own_tempo", "pulse", "share")
NUMBERS = ("harmony_above_chance", "p_value", "harmony", "hit_rate", "chance", "n_audio", "n_visual")
COLUMNS = {"harmony above chance": "harmony_above_chance", "p in time": "p_time"}
PAPER_COLUMNS = {"harmony": "paper_harmony", "hit rate": "paper_hit_rate", "chance": "paper_chance"}


def is_corpus(folder: Path) -> bool:
    """True for a folder that is no recording itself and holds some."""
    from harmolab.data.recordings import find_recordings, missing_parts

    return folder.is_dir() and bool(missing_parts(folder)) and bool(find_recordings(folder).folders)


def score_corpus(
    context: typer.Context, corpus: Path, scored: ScoredRecording, *, dance: str, table: Path | None, as_json: bool
) -> None:
    """Score every recording below a folder, print the rows and write them; exit code 1 where some have a fault.

    Parameters
    ----------
    context : of the call
    corpus : folder
    scored : function of the files of a recording; mode -> score
    dance : that of all recordings, in place of their own; "" for their own
    table : csv to be written, if any
    as_json : print the rows as JSON
    """
    check_untold(context, FOR_ONE, f"is for one recording, and {corpus} holds several; leave it out")
    common.check_out(table, "a table", (".csv",))
    rows = list(recording_rows(corpus, scored, dance=dance))
    if table is not None:
        import pandas as pd

        write_text(table, pd.DataFrame(rows).to_csv(index=False))
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
    else:
        _print(rows, str(corpus))
    wrote(table, err=as_json)
    if faults := [row["name"] for row in rows if row["error"]]:
        note(f"{len(faults)} of {len(rows)} recordings could not be scored; their rows say why")
        raise typer.Exit(1)


def recording_rows(corpus: Path, scored: ScoredRecording, *, dance: str = "") -> Iterator[dict[str, Any]]:
    """A row for each recording at or below a folder; errors of the folder itself as `find_recordings`.

    All are of this `dance`, or each of its own.
    """
    from harmolab.data.recordings import find_recordings, recording_files

    folders, problems = find_recordings(corpus)
    for problem in problems:
        yield _row(problem.folder, corpus, error=problem.message)
    for folder in progress(folders, "scoring"):
        try:
            files = recording_files(folder)
            named = dance or files.dance
            yield _row(folder, corpus, dance=named, scores=scored(Sources(files.song, folder, files.beats, named)))
        except (ValueError, OSError) as error:
            yield _row(folder, corpus, error=str(error))


def _row(
    folder: Path, corpus: Path, *, dance: str = "", scores: Mapping[str, HarmonyScore] | None = None, error: str = ""
) -> dict[str, Any]:
    """Name, dance, numbers and fault of a recording; the numbers of our own score go by their names alone."""
    row: dict[str, Any] = {"name": str(folder.relative_to(corpus)), "dance": dance, "error": printable(error)}
    for mode, score in (scores or {}).items():
        values, prefix = score.to_dict(), "" if score.judgement else f"{mode}_"
        low, high = values["interval"]
        row |= {f"{prefix}{name}": values[name] for name in (*(JUDGED if score.judgement else ()), *NUMBERS)}
        row |= {f"{prefix}interval_low": low, f"{prefix}interval_high": high}
    return row


def _print(rows: list[dict[str, Any]], title: str) -> None:
    """The rows as a table, the fault of a recording in place of its level; the paper's numbers if those are all."""
    from harmolab.verdict.judge import LEVELS

    is_paper = any("paper_harmony" in row for row in rows) and not any("level" in row for row in rows)
    columns = PAPER_COLUMNS if is_paper else COLUMNS

    def cells(row: Mapping[str, Any]) -> tuple[str, ...]:
        numbers = (row.get(name) for name in columns.values())
        level = f"{row['level']} {LEVELS[row['level']]}" if "level" in row else ""
        return row["name"], row["dance"], *map(common.show, numbers), row["error"] or level

    common.print_table(("recording", "dance", *columns, "fault" if is_paper else "level"), map(cells, rows), title)


# Names in the table, and of the fields behind them.
NUMBER_ROWS = {
    "harmony above chance": "harmony_above_chance", "its spread from bar to bar": "interval", "p value": "p_value",
}  # fmt: skip
JUDGEMENT_ROWS = {
    "level, 0 to 4": "level", "p in time": "p_time", "p in place": "p_place", "lag, s": "lag_s",
    "tempo of the music, bpm": "tempo", "own tempo, bpm": "own_tempo", "pulse, 1/s": "pulse",
    "share inside the body": "share", "share of the joints": "joints",
}  # fmt: skip
PAPER_ROWS = {"harmony": "harmony", "hit rate": "hit_rate"}
COUNT_ROWS = {"chance": "chance", "n audio": "n_audio", "n visual": "n_visual"}


@common.with_options
def score(
    context: typer.Context,
    song: common.Song,
    motion: common.Dance = None,
    offset: common.Offset = None,
    seconds: common.Seconds = None,
    mode: Literal["paper", "recommended", "both"] = "both",
    *,
    judged: common.JudgeOptions,
    read: common.FileOptions,
    page: PageOptions,
    lag: float = 0.0,
    clock: Annotated[float, typer.Option(min=0.1, max=10.0)] = 1.0,
    as_json: common.AsJson = False,
    csv: Annotated[Path | None, typer.Option("--csv")] = None,
    plot: Path | None = None,
    others: Annotated[bool, typer.Option("--others")] = False,
    _start: Annotated[str | None, common.renamed("--start", "--offset")] = None,
    _duration: Annotated[str | None, common.renamed("--duration", "--seconds")] = None,
) -> None:
    """Score a motion against its music: is it in time, and on the beat?

    The verdict comes first, in words. Below it stands how sure that is, how steady, and what would help. Sixteen beats
    are needed.

    With neither --dance nor --how you are on the beat where you rest on it, or move as in a waltz. A hit of the beat,
    or an arrival on it, is named, and not called late. With --dance, early and late count from what its dancers do;
    with --how, from what you mean to do.

    All numbers, those of the paper too, come with --verbose and --json. `harmony above chance` is 1 where every beat is
    the best moment of the take, 0 at a random lag, and -1 where every beat is the worst moment. Its p value is the
    larger of two: that of being in time (against other tempi), and that of the place in the beat (against other lags).
    The paper's `harmony` and `hit rate` mean little without the `chance` beside them: at T_delay = 0.25 s most of the
    time lies near a beat anyway.

    Examples:

    `harmolab score song.mp3 dance.bvh --offset 12.4 --dance waltz --plot score.png`

    `harmolab score recordings/DANCE_W_3` reads song, motion, dance and annotated beats from one folder.

    `harmolab score recordings --csv table.csv` scores all recordings in a folder.

    `harmolab score phone_video.mp4` scores a video with its music in it.

    `harmolab score song.mp3 phone_video.mp4 --why page.html` shows why, and finds where in the song the dance begins.

    `harmolab score take/audio.wav take/points.json --instrument piano --why page.html`: do the hands meet the notes?

    Parameters
    ----------
    mode : The paper's settings, ours, or both.
    lag : Seconds by which this dancer is expected after the beat.
    clock : Factor by which the time of the motion is stretched; 1.013 fits most Tang 2018 data.
    csv : Of a folder of recordings: write a table, .csv, with a row for each.
    plot : Save a picture (png, svg, pdf) of beats, hits and misses, of ten minutes at most; its p is that of being in
        time.
    others : Print the field's other measures too: beat alignment, mir_eval.
    """
    from harmolab.clips import check_dance
    from harmolab.verdict.judge import music_and_motion, other_measures, score_motion, without_start

    def scored(files: Sources) -> Scored:
        modes = settings(mode, judged, judged.dance or files.dance, lag=lag, clock=clock)
        clip = clip_of(files, offset=offset, seconds=seconds, **read.keywords)
        music, movement = music_and_motion(clip, clock=clock)
        scores = {name: score_motion(music, movement, params=params) for name, params in modes.items()}
        check_signs(files, clip, scores.values())
        if not clip.has_start:
            scores = {name: without_start(score) for name, score in scores.items()}
        return Scored(clip, music, scores)

    check_options(context, page, mode)
    if page.why is not None:
        explain(context, page.why, song, motion, page, judged, read, offset=offset, as_json=as_json)
        return
    if motion is None and is_corpus(song):
        if judged.pattern is None:  # a file of patterns has names of its own
            check_dance(judged.dance)
        score_corpus(context, song, lambda files: scored(files).scores, dance=judged.dance, table=csv, as_json=as_json)
        return
    check_untold(context, ("csv",), f"is for a folder of recordings; --json has all numbers of {song}")
    if plot:
        common.check_place(plot)
    files = sources(context, song, motion, judged)
    clip, music, scores = scored(files)
    measures = other_measures(clip, clock=clock) if others else {}
    if plot:
        from harmolab.lab.figures.style import write_figure

        title, begin = printable(clip.name), max(clip.offset, 0.0)
        write_figure(lab.score_figure(scores, title=title, longest=LONGEST_PLOT, begin=begin), plot)
        if music.duration > LONGEST_PLOT:
            note(f"{plot} shows the first {LONGEST_PLOT / 60:.0f} minutes")
    if as_json:
        about = {"audio": str(files.song), "motion": str(files.motion), "offset": clip.offset, "version": __version__}
        about |= {"beats": str(files.beats or "tracked"), "dance": files.dance, "music": harmolab.describe_beats(music)}
        content = {"clip": about, **{name: result.to_dict() for name, result in scores.items()}}
        typer.echo(json.dumps(content | ({"others": measures} if others else {}), indent=2))
        wrote(plot, err=True)
        return
    for score in scores.values():
        common.print_verdict(score.judgement)
    common.print_music(music)
    if mode == "paper" or measures or is_verbose():
        print_scores(scores, measures)
    wrote(plot)


class Scored(NamedTuple):
    """A clip, its music's beats on the motion's time line, and mode -> score."""

    clip: harmolab.Clip
    music: harmolab.BeatTrack
    scores: dict[str, HarmonyScore]


def settings(
    mode: str, judged: common.JudgeOptions, dance: str, *, lag: float, clock: float
) -> dict[str, harmolab.HarmonyParams]:
    """The parameters of each mode, for what was told of the dance."""
    params = {"recommended": judged.params(dance), "paper": harmolab.HarmonyParams.paper()}
    names = ("paper", "recommended") if mode == "both" else (mode,)
    return {name: replace(params[name], lag=lag, clock=clock) for name in names}


def print_scores(scores: dict[str, HarmonyScore], measures: dict[str, float]) -> None:
    """A table with a row a number and a column a mode, and the other measures, if any."""
    columns = [dict(score_rows(score)) for score in scores.values()]
    rows = ((name, *(column[name] for column in columns)) for name in columns[0])
    common.print_table(["", *scores], (row for row in rows if any(row[1:])), "harmony of motion and music")
    if measures:
        rows = ((name, common.show(value)) for name, value in measures.items())
        common.print_table(["", ""], rows, "other measures of the field", show_header=False)


def score_rows(score: HarmonyScore) -> Iterator[tuple[str, str]]:
    """Name and text of each number of a score: "-" where it does not exist, "" where it is no number of this mode."""
    from harmolab.verdict.evidence import FEWEST_BEATS

    values = score.to_dict()
    if values["n_audio"] < FEWEST_BEATS or math.isnan(score.above_chance):
        values |= dict.fromkeys(NUMBER_ROWS.values())
    if values.get("level", 0) < 3:
        values["lag_s"] = None
    of_other_mode = PAPER_ROWS if "level" in values else JUDGEMENT_ROWS
    for name, key in (NUMBER_ROWS | JUDGEMENT_ROWS | PAPER_ROWS | COUNT_ROWS).items():
        yield name, "" if name in of_other_mode else common.show(values[key])
