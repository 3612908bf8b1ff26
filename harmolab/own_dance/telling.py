"""A recording beside its song: scored, and told in words.

Where the start was found from the movement alone, nothing can be said about being early or late throughout, and
nothing is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.alignment import attack_beats
from harmolab.beats.visual import visual_beats
from harmolab.explaining import Explanation, Finding, explain
from harmolab.harmony import first_shared, overlap, score_motion
from harmolab.io.files import PathLike
from harmolab.io.video_sound import load_sound
from harmolab.own_dance.recording import Placement, Recording, place_recording
from harmolab.params import HarmonyParams
from harmolab.types import Audio, BeatTrack, Clip, HarmonyScore, Motion

__all__ = ["OwnDance", "explain_recording"]

FEWEST_FINDINGS = 3  # score, beats met, and whatever comes after them


@dataclass(frozen=True, eq=False)
class OwnDance:
    """A dance beside its song, scored.

    Parameters
    ----------
    song : str, name of the file
    recording : Recording
    audio : Audio, the part of the song that is danced to
    music, visual : BeatTrack on the dance's time line
    motion : Motion, the part of the dance that has music
    skipped : float, seconds of the dance before that part
    placement : Placement
    score : HarmonyScore
    words : Explanation
    params : HarmonyParams
    """

    song: str
    recording: Recording
    audio: Audio
    music: BeatTrack
    visual: BeatTrack
    motion: Motion
    skipped: float
    placement: Placement
    score: HarmonyScore
    words: Explanation
    params: HarmonyParams

    @property
    def name(self) -> str:
        """Name of the recording's file or folder."""
        return self.recording.path.name or str(self.recording.path)

    @property
    def is_together(self) -> bool:
        """Whether there is evidence that the dancer keeps time with the song, be it early or late.

        Movements keep a place in the beat, or fit the song better than chance. The p-value of the score would not do:
        a steady dancer who is late fits better after a shift in time, and many shifts do as well.
        """
        return self.placement.is_sure and (self._is_steady or self.score.interval[0] > 0)

    @property
    def _is_steady(self) -> bool:
        return self.words.findings[-1].kind in ("mean", "change", "drift")

    @property
    def verdict(self) -> str:
        """The result in a sentence or two for a dancer."""
        if not self.placement.is_sure:
            return "It is not clear where in this song you dance: beats of another tempo fit your movement as well."
        if len(self.words.findings) < FEWEST_FINDINGS:
            return "There is too little dance or music here to say anything."
        if not self.is_together:
            return "There is no evidence here that you move with the beats of this song."
        if not self._is_steady:
            return "You move with this song, but keep no steady place in its beat."
        return "You keep time with this song. " + _short(self.words.findings[-1], self.placement)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and text, ready for JSON."""
        low, high = self.score.interval
        return {
            "song": self.song,
            "recording": self.name,
            "verdict": self.verdict,
            "words": list(self.words.sentences),
            "findings": [_plain(finding) for finding in self.words.findings],
            "offset": {"text": str(self.placement), **vars(self.placement)},
            "harmony_above_chance": self.score.harmony_above_chance,
            "interval": [low if np.isfinite(low) else None, high if np.isfinite(high) else None],
            "p_value": self.score.p_value if np.isfinite(self.score.p_value) else None,
            "music_beats": len(self.music),
            "movements": len(self.visual),
            "seconds": self.motion.duration,
        }


def _plain(finding: Finding) -> dict[str, Any]:
    """A finding for JSON; a number that does not exist is None."""
    numbers = [number if np.isfinite(number) else None for number in (finding.value, *finding.interval)]
    return {"kind": finding.kind, "sentence": finding.sentence, "value": numbers[0], "interval": numbers[1:]}


def _short(finding: Finding, placement: Placement) -> str:
    """Early or late in a few words, as far as the placement lets it be told."""
    milliseconds = f"{abs(finding.value) * 1000:.0f} ms"
    if finding.kind == "change":
        if placement.is_absolute:
            return finding.sentence.partition(" (")[0] + "."
        turn = "later" if finding.value > 0 else "earlier"
        return f"In the second half you are {milliseconds} {turn} than in the first."
    if finding.kind == "drift":
        drift = f"{abs(finding.value) * 10_000:.0f} ms every ten seconds"
        return f"You fall behind by {drift}." if finding.value > 0 else f"You run ahead by {drift}."
    if not placement.is_absolute:
        return "You keep the same place in its beat throughout."
    return finding.sentence.partition(" (")[0].partition(":")[0] + "."


def explain_recording(
    song: PathLike,
    recording: Recording,
    *,
    offset: float | None = None,
    guess: float | None = None,
    search: float = 2.0,
    beats: BeatTrack | None = None,
    dance: str = "",
    params: HarmonyParams | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> OwnDance:
    """A recording beside a song: placed, scored and told in words.

    Parameters
    ----------
    song : str or path, a sound file or a video (the recording itself, where the song plays in it)
    recording : Recording
    offset : float, seconds, optional
        Song time of the recording's first frame. Left out, `place_recording` finds it.
    guess, search : see `place_recording`
    beats : BeatTrack, optional
        Of the song; left out, they are tracked.
    dance : str
        A prior for the tempo ("waltz", ...).
    params : HarmonyParams, default ``HarmonyParams.recommended()``
    n_rotations, seed : see `harmolab.harmony.score_motion`

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    chosen = params or HarmonyParams.recommended()
    audio = load_sound(song)
    track = attack_beats(audio, tempo=dance or None) if beats is None else beats
    if offset is not None:
        placement = Placement(offset, "given")
    elif recording.is_video and Path(song).resolve() == recording.path.resolve():
        placement = Placement(0.0, "same")
    else:
        placement = place_recording(recording, audio, track, guess=guess, search=search)
    try:
        clip = Clip(recording.path.name, audio, recording.motion, placement.seconds)
    except ValueError as error:
        raise ValueError(f"{recording.path}: {error}") from None
    music, motion = overlap(clip, track)
    score = score_motion(music, motion, params=chosen, n_rotations=n_rotations, seed=seed)
    visual = visual_beats(motion, params=chosen)
    words = explain(score, music, visual, params=chosen)
    skipped, start = first_shared(placement.seconds, 1 / motion.fps)
    return OwnDance(
        Path(song).name,
        recording,
        audio.span(start, motion.duration),
        music,
        visual,
        motion,
        skipped / motion.fps,
        placement,
        score,
        words if placement.is_absolute else _relative(words),
        chosen,
    )


def _relative(words: Explanation) -> Explanation:
    """The same words without those about early or late throughout, which a start found by movement cannot tell."""
    last = words.findings[-1]
    low, high = (1000 * end for end in last.interval)
    span = f"95 % interval {low:.0f} to {high:.0f} ms"
    if last.kind == "change":
        turn = f"{abs(last.value) * 1000:.0f} ms {'later' if last.value > 0 else 'earlier'}"
        sentence = f"You are {turn} on the second half than on the first ({span})."
    elif last.kind == "drift":
        sentence = "Your timing drifts: " + last.sentence.partition(" (")[2].removesuffix(").") + "."
    elif last.kind == "mean":
        sentence = (
            "You keep the same place in the beat throughout. Whether that is early or late cannot be told from your "
            "movement alone: give the offset."
        )
    else:
        return words
    return replace(words, findings=(*words.findings[:-1], replace(last, sentence=sentence)))
