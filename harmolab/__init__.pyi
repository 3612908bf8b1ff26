from .beats.audio import audio_beats as audio_beats
from .beats.audio import music_beats as music_beats
from .beats.audio import onset_envelope as onset_envelope
from .beats.clicks import with_clicks as with_clicks
from .beats.flow import flow_envelope as flow_envelope
from .beats.impacts import envelope_beats as envelope_beats
from .beats.meter import MeterUnit as MeterUnit
from .beats.meter import describe_beats as describe_beats
from .beats.meter import meter_units as meter_units
from .beats.meter import strong_beats as strong_beats
from .beats.meter import with_one as with_one
from .beats.notes import bow_turns as bow_turns
from .beats.notes import note_beats as note_beats
from .beats.notes import onset_beats as onset_beats
from .beats.notes import strikes as strikes
from .beats.saliency import salient_audio as salient_audio
from .beats.saliency import salient_visual as salient_visual
from .beats.visual import motion_curve as motion_curve
from .beats.visual import visual_beats as visual_beats
from .corpora.files import load_clip as load_clip
from .corpora.files import score_files as score_files
from .corpora.folders import (
    Recording as Recording,
)
from .corpora.folders import (
    find_recordings as find_recordings,
)
from .corpora.folders import (
    iter_recordings as iter_recordings,
)
from .corpora.folders import (
    load_recording as load_recording,
)
from .corpora.synthetic.beats import ClipSettings as ClipSettings
from .corpora.synthetic.clip import (
    PlantedClip as PlantedClip,
)
from .corpora.synthetic.clip import (
    planted_clip as planted_clip,
)
from .corpora.synthetic.clip import (
    synthetic_clip as synthetic_clip,
)
from .corpora.synthetic.corpus import write_corpus as write_corpus
from .corpora.synthetic.dance import synthetic_motion as synthetic_motion
from .harmony import (
    above_chance as above_chance,
)
from .harmony import (
    chance_level as chance_level,
)
from .harmony import (
    f_score as f_score,
)
from .harmony import (
    harmony_from_hits as harmony_from_hits,
)
from .harmony import (
    hit_mask as hit_mask,
)
from .harmony import (
    hit_pairs as hit_pairs,
)
from .harmony import (
    hitting_score as hitting_score,
)
from .harmony import (
    music_and_motion as music_and_motion,
)
from .harmony import (
    nearest_intervals as nearest_intervals,
)
from .harmony import (
    other_measures as other_measures,
)
from .harmony import (
    score_clip as score_clip,
)
from .harmony import (
    score_harmony as score_harmony,
)
from .harmony import (
    score_motion as score_motion,
)
from .io.audio import load_audio as load_audio
from .io.beats import load_beats as load_beats
from .io.beats import save_beats as save_beats
from .io.motion import load_motion as load_motion
from .io.motion import save_motion as save_motion
from .io.video import write_video as write_video
from .io.video_sound import load_sound as load_sound
from .lab.compare.auc import compare as compare
from .lab.timing.harmonise import harmonise as harmonise
from .metrics.beats import beat_align as beat_align
from .metrics.beats import mir_eval_scores as mir_eval_scores
from .metrics.beats import other_scores as other_scores
from .metrics.frechet import diversity as diversity
from .metrics.frechet import frechet_distance as frechet_distance
from .metrics.likeness import LikenessLimits as LikenessLimits
from .metrics.likeness import likeness as likeness
from .metrics.playing import PlayingScore as PlayingScore
from .metrics.playing import playing_score as playing_score
from .metrics.quality import foot_skating as foot_skating
from .metrics.quality import jerk as jerk
from .params import DANCES as DANCES
from .params import HOW_PATTERNS as HOW_PATTERNS
from .params import BarPattern as BarPattern
from .params import HarmonyParams as HarmonyParams
from .significance import auc as auc
from .significance import p_value as p_value
from .skeletons import body_frame as body_frame
from .types import (
    Audio as Audio,
)
from .types import (
    BeatTrack as BeatTrack,
)
from .types import (
    Clip as Clip,
)
from .types import (
    Motion as Motion,
)
from .types import (
    Skeleton as Skeleton,
)
from .verdict.score import HarmonyScore as HarmonyScore

__version__: str
