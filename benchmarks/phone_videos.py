"""Verdicts on videos as a phone makes them, beside those on the true movement: what reading a video costs.

`python -m benchmarks.phone_videos FOLDER [CASE ...]` films the four dancers of `DANCERS` in the cases named, or in
all of `CASES`, and prints the levels of the verdict, also 120 ms late and with another song, beside those of the true
movement. Videos that are there are not filmed again; HARMOLAB_POSE=off reads them by flow.
"""

import sys
from dataclasses import replace
from pathlib import Path

from harmolab.lab.explain.filmed import filmed_motion
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.judge import score_motion
from tests.builders import planted_dance, track
from tests.phone_videos import Phone, agreement, film, filmed_part

LATE = 0.12  # seconds
DANCERS = (("cha-cha", 1), ("waltz", 2), ("rumba", 3), ("cha-cha", 4))  # dance and seed
OTHER_SONGS = (("waltz",), ("cha-cha",), ("tango",), ("waltz",))
SECONDS = 30.0

CASES = {
    "good": Phone(),
    "noise 4": Phone(noise=4, crf=23),
    "noise 8": Phone(noise=8),
    "shake": Phone(shake=1.0),
    "worst": Phone(noise=6, shake=1.5, crf=35),
    "15 fps": Phone(fps=15, noise=3, crf=32),
    "60 fps": Phone(fps=60, noise=3, shake=0.5),
    "two people": Phone(people=2),
    "no feet": Phone(has_feet=False, shake=0.5),
    "plain wall": Phone(contrast=0.0, noise=0, crf=23),
}


def moved(beats: BeatTrack, seconds: float) -> BeatTrack:
    """The beats earlier by so many seconds: the dancer is late by them."""
    times = beats.times - seconds
    return track(times[times >= 0], fps=beats.fps, duration=beats.duration)


def level(beats: BeatTrack, motion: Motion) -> int:
    """Level of the verdict by the recommended settings."""
    return score_motion(beats, motion, params=HarmonyParams.recommended()).judgement.level


def main(folder: Path, names: list[str]) -> None:
    """Film every dancer in every case that is named, and print the levels of the true and of the filmed movement."""
    for number, (dance, seed) in enumerate(DANCERS):
        motion, sound, beats = filmed_part(planted_dance(dance, seconds=SECONDS, seed=seed))
        other = planted_dance(*OTHER_SONGS[number], seconds=SECONDS, seed=9).beats.span(0.0, motion.duration)
        songs = {"on": beats, "late": moved(beats, LATE), "other": other}
        print(dance, seed, "true", *(f"{name} {level(song, motion)}" for name, song in songs.items()), flush=True)
        for name in names or list(CASES):
            path = folder / f"{dance}_{seed}_{name.replace(' ', '_')}.mp4"
            if not path.exists():
                film(path, motion, sound, replace(CASES[name], seed=number))
            try:
                read = filmed_motion(path)
            except ValueError as error:
                print(" ", error, flush=True)
                continue
            levels = " ".join(f"{song} {level(beats, read.motion)}" for song, beats in songs.items())
            r, shift = agreement(motion, read.motion)
            print(f"  {name}: {levels}; agrees {r:.2f} at {1000 * shift:+.0f} ms; {'; '.join(read.notes)}", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
