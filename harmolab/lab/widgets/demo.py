"""A page to begin with, made of what comes with harmolab: one dance twice, in time with its music and late."""

from __future__ import annotations

from dataclasses import dataclass

from harmolab.corpora.synthetic.beats import ClipSettings
from harmolab.corpora.synthetic.music import planted_music
from harmolab.harmony import score_motion
from harmolab.lab.widgets.player import Dancer, Player
from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.verdict.score import HarmonyScore

SONG, TEMPO = "rumba", 75.0  # beats a minute
SECONDS = 25.0
SEED = 2  # a dance that meets nearly all beats; picked to show clearly what is in time, and no result
LATE = 0.25  # of a beat: half a beat late, rests on the beat become hits on it
NOTICE = (
    "The song is synthetic: a small band that a program plays. The movement is recorded salsa (CMU Graphics Lab Motion "
    "Capture Database), laid on the beats by harmolab. Both dancers are the same one; the right one moves {late:.2f} s "
    "later, a quarter of a beat."
)
FACTS = {
    "try": "slow motion and the clicks: do the body and the beat come to rest together?",
    "movement": "subject 61 of mocap.cs.cmu.edu, a database created with funding from NSF EIA-0196217",
    "chosen": "the dance was picked since it meets most beats: it shows what the words mean and is no result",
}


@dataclass(frozen=True, eq=False)
class Demo:
    """A page with two dancers and the scores of both.

    Parameters
    ----------
    player : Player
    late : float, seconds that the second dancer is late
    in_time, delayed : HarmonyScore of the first and of the second
    """

    player: Player
    late: float
    in_time: HarmonyScore
    delayed: HarmonyScore


def demo() -> Demo:
    """The page, made anew in a few seconds; nothing is read but what comes with harmolab, and no beats are tracked.

    Raises
    ------
    FileNotFoundError
        If the recorded movement was left out of this installation.

    Examples
    --------
    >>> demo().player.save("demo.html")  # doctest: +SKIP
    """
    music = planted_music(ClipSettings(SONG, seconds=SECONDS, tempo=TEMPO, seed=3))
    motion = shipped_bank().choreograph(music.audio, music.beats, seed=SEED).motion
    late = round(LATE * 60.0 / TEMPO * motion.fps) / motion.fps
    length = motion.duration - late
    beats = music.beats.span(late, length)
    motions = {"in time": motion.span(late, length), "late": motion.span(0.0, length)}
    # Laid with its rests on the beats, so a rest is what is asked for.
    params = HarmonyParams.recommended(HOW_PATTERNS["rest"])
    dancers = [Dancer(name, each, score_motion(beats, each, params=params)) for name, each in motions.items()]
    player = Player(
        music.audio.span(late, length), dancers, music=beats, title="harmolab demo: the same dance, in time and late",
        facts=FACTS, notice=NOTICE.format(late=late),
    )  # fmt: skip
    return Demo(player, late, dancers[0].score, dancers[1].score)
