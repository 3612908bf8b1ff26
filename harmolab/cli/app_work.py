"""The work behind the page of `harmolab app`: a verdict with its pages, a dance made to fit, a dance to a song."""

import io
import re
from collections.abc import Callable
from contextlib import chdir, redirect_stderr, redirect_stdout
from contextvars import copy_context
from dataclasses import replace
from pathlib import Path

from harmolab.cli.common import OF_LAB, UNUSUAL, CommandWithParts, dance_title, faults_in, of_lab, recommended
from harmolab.cli.dancing import dance as dance_command
from harmolab.cli.dancing import sentence
from harmolab.cli.retiming import WORSE, instead, is_worse
from harmolab.cli.screen import WATCHER
from harmolab.cli.sources import music_remarks, tempo_remark
from harmolab.clips import load_clip
from harmolab.data.recordings import recorded_offset
from harmolab.files import PathLike, named_faults
from harmolab.lab.app import Order, Teller
from harmolab.lab.explain.filmed import points_in_video
from harmolab.lab.explain.page import dance_player, save_page
from harmolab.lab.explain.performance import OwnDance, explain_performance, load_performance
from harmolab.lab.labs.one_clip import scoring_lab
from harmolab.lab.player_data import LONGEST, player_of
from harmolab.lab.render.video import retime_files, write_dance
from harmolab.params import HarmonyParams
from harmolab.readers.motion_file import MotionFile
from harmolab.readers.video import is_video
from harmolab.retime.retime import Retimed
from harmolab.types import BeatTrack
from harmolab.verdict.judge import without_start

DANCE_VIEWS = (("page", ".html", "A dance to the song"), ("film", ".mp4", "A video"), ("file", ".bvh", "For Blender"))
BY_FLOW = "To have your body read, and not all that moves, type once in a terminal: harmolab data pose --install"


def work(order: Order, teller: Teller) -> None:
    """Do what was asked for; ValueError or OSError, in a sentence, where it cannot be done."""
    TASKS[order.task](order, teller)


def _pair(order: Order) -> tuple[Path, Path]:
    """The song and the dance, which may be one video."""
    if order.dance is None:
        raise ValueError("Choose a dance first: a video, or a file of movement.")
    if order.song is None and not is_video(order.dance):
        raise ValueError(f"{order.dance.name}: a file of movement has no sound; choose its song too.")
    return order.song or order.dance, order.dance


def judge(order: Order, teller: Teller) -> None:
    """The verdict, and below it what shows why."""
    song, dance = _pair(order)
    remarks: list[str] = []

    def report(path: PathLike, file: MotionFile) -> None:
        remarks.extend((*(one.brief for one in file.assumptions), *faults_in(file.motion)))

    performance = load_performance(dance, report=report, progress=teller.progress)
    teller.step("listening to the music")
    params = recommended(None, order.style, order.how)
    result = explain_performance(song, performance, offset=order.offset, dance=order.style, params=params)
    notes = [*map(sentence, performance.notes)] if performance.has_body else [BY_FLOW]
    notes += map(sentence, remarks)
    if order.style and not order.how:
        judged = "Judged as a {}, as you said." if params.pattern else UNUSUAL
        notes.append(sentence(judged.format(order.style)))
    until = result.skipped + result.motion.duration
    notes += map(sentence, music_remarks(result.skipped, until, performance.motion.duration, song))
    notes += _tempo(song, order.style, result.music)
    lines, place = [*result.summary, *notes], result.placement
    teller.lines(lines, is_good=result.is_together, offset=place.seconds, has_start=place.is_absolute)
    if not performance.is_video and result.motion.duration <= LONGEST:
        _view(order, teller, "player.html", "Player", dance_player(result).save)
    _view(order, teller, "why.html", "Why", lambda path: save_page(path, result))
    clip, part = result.clip.span(0.0, min(OF_LAB, result.audio.duration)), of_lab(result.clip)
    lab = scoring_lab(clip, pattern=params.pattern, name=dance_title(dance, song) + part, mode="recommended")
    _view(order, teller, "lab.html", f"Sliders{part}", lab.save)
    if performance.is_video:
        teller.view("film", _film(order, teller, song, result, params), "Your video with its beats")


def _view(order: Order, teller: Teller, name: str, title: str, save: Callable[[Path], None]) -> None:
    """Write a page and show it."""
    teller.step(f"making the page: {title}")
    save(order.folder / name)
    teller.view("page", order.folder / name, title)


def _film(order: Order, teller: Teller, song: Path, result: OwnDance, params: HarmonyParams) -> Path:
    """The dancer's own video with the beats and the verdict in the picture."""
    motion, video = result.performance.motion, result.performance.path
    out = order.folder / f"{video.stem}_beats.mp4"
    clip = load_clip(song, motion, offset=result.placement.seconds, dance=order.style, sample_rate=None)
    points, verdict = points_in_video(video), result.verdict
    write_dance(out, clip, over=video, points=points, verdict=verdict, params=params, progress=teller.progress)
    return out


def fit(order: Order, teller: Teller) -> None:
    """The dance with its time bent until it rests on the beats, to look at and to keep."""
    song, dance = _pair(order)
    if order.offset is None and song != dance and recorded_offset(dance) is None:
        raise ValueError('Ask "Am I in time?" first, or say where the dance begins: it is not known yet.')
    kept = ".bvh" if dance.suffix.lower() == ".bvh" else ".npz"
    out = order.folder / f"{dance.stem}_in_time{'.mp4' if is_video(dance) else kept}"
    # A start that was found from the movement lays its rests on the beats, whatever is meant.
    how = order.how if order.has_start or order.how != "hit" else "rest"
    params = recommended(None, order.style, how)
    goal, phase = ("the moments half way between beats", 0.5) if how == "hit" else ("the beats", 0.0)
    retimed = retime_files(
        song, dance, out, offset=order.offset, dance=order.style, params=params, phase=phase, progress=teller.progress,
    )  # fmt: skip
    if not order.has_start:
        retimed = replace(retimed, before=without_start(retimed.before), after=without_start(retimed.after))
    begin = order.offset if order.offset is not None else recorded_offset(dance) or 0.0
    place = [f"All of this holds if your dance begins at {begin + 0.0:.2f} s of the song."] if song != dance else []
    teller.lines([*_bent(retimed, dance, goal), *place, *_tempo(song, order.style, retimed.before.music)])
    if is_video(dance):
        teller.view("film", out, "Your video, in time")
        return
    clip = load_clip(song, out, offset=order.offset, dance=order.style, sample_rate=None)
    if clip.shared().audio.duration <= LONGEST:
        player = player_of([replace(clip, has_start=order.has_start)], params=params)
        _view(order, teller, "in_time.html", "Your dance, in time", player.save)
    teller.view("file", out, "The movement")


def _tempo(song: Path, style: str, music: BeatTrack) -> list[str]:
    """A sentence where the name of the dance bends the tempo of the music."""
    return [sentence(remark)] if (remark := tempo_remark(song, style, music)) else []


def _bent(retimed: Retimed, dance: Path, goal: str) -> list[str]:
    """Sentences about the bending of rests to a goal, and the verdicts before and after."""
    if len(retimed.before.music) == 0:
        return ["No beats were found in the music: nothing could be bent."]
    before, after = (
        instead(score, dance, retimed) or (score.judgement.verdict if score.judgement else "no verdict")
        for score in (retimed.before, retimed.after)
    )
    near = [f"{target.hit_rate:.0%}" for target in (retimed.target_before, retimed.target_after)]
    if retimed.warp.is_identity:
        return [f"Nothing was worth bending: you rest near {near[0]} of {goal}.", f"As it is: {before}"]
    return [
        *([WORSE] if is_worse(retimed) else ()),
        f"You rest near {near[1]} of {goal} now, and before near {near[0]}.",
        f"Time was bent by {1000 * retimed.warp.bent:.0f} ms on average; no pose was changed.",
        f"Before: {before}",
        f"After: {after}",
    ]


def dance(order: Order, teller: Teller) -> None:
    """A dance to the song by `harmolab dance`, with its words and its files."""
    song = order.song or order.dance
    if song is None or (order.song is None and not is_video(song)):
        raise ValueError("Choose a song first, or a video with music.")
    output, fault = io.StringIO(), io.StringIO()
    words = [str(song), "--dance", order.style] if order.style else [str(song)]
    with chdir(order.folder), redirect_stdout(output), redirect_stderr(fault), named_faults(song):
        command = CommandWithParts.of(dance=dance_command).part("dance")
        context = copy_context()
        context.run(WATCHER.set, teller)
        code = context.run(command.main, words, prog_name="harmolab dance", standalone_mode=False)
    notes = re.findall("^harmolab: (.+)$", fault.getvalue(), re.MULTILINE)
    if code:
        raise ValueError(notes[-1])
    lines = [line.strip() for line in output.getvalue().splitlines() if not line.startswith("wrote ")]
    teller.lines([*lines, *map(sentence, notes)])
    for kind, suffix, title in DANCE_VIEWS:
        if (path := order.folder / f"{song.stem}_dance{suffix}").exists():
            teller.view(kind, path, title)


TASKS = {"judge": judge, "fit": fit, "dance": dance}
