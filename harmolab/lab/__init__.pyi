from .evaluate.body_rests import rests_on_beat as rests_on_beat
from .evaluate.engine import run_rows as run_rows
from .evaluate.evaluation import Evaluation as Evaluation
from .evaluate.evaluation import evaluate_dances as evaluate_dances
from .evaluate.protocols import PROTOCOLS as PROTOCOLS
from .evaluate.protocols import Protocol as Protocol
from .evaluate.settings import EvaluationSettings as EvaluationSettings
from .experiments.ablated import ablated_dancers as ablated_dancers
from .experiments.ablated import ablation_table as ablation_table
from .experiments.ablated import effector_disagreement as effector_disagreement
from .experiments.ablated import end_effectors as end_effectors
from .experiments.ablated import hand_heights as hand_heights
from .experiments.ablation import (
    ablation as ablation,
)
from .experiments.ablation import (
    forced_choice as forced_choice,
)
from .experiments.ablation import (
    gains as gains,
)
from .experiments.ablation import (
    seed_means as seed_means,
)
from .experiments.ablation import (
    targets_met as targets_met,
)
from .experiments.ablation import (
    trade_off as trade_off,
)
from .experiments.attribute_tables import attribute_confusion as attribute_confusion
from .experiments.attribute_tables import attribute_differences as attribute_differences
from .experiments.attribute_tables import attribute_outcomes as attribute_outcomes
from .experiments.attribute_tables import attribute_table as attribute_table
from .experiments.attribute_tables import song_probabilities as song_probabilities
from .experiments.attributes import bar_starts as bar_starts
from .experiments.attributes import example_song as example_song
from .experiments.attributes import training_remark as training_remark
from .experiments.avatar_depth import DEPTH_LIMITS as DEPTH_LIMITS
from .experiments.avatar_depth import depth_table as depth_table
from .experiments.banks import bank_table as bank_table
from .experiments.chance import chance_table as chance_table
from .experiments.cheating import (
    cheating as cheating,
)
from .experiments.cheating import (
    generators_half_a_beat_late as generators_half_a_beat_late,
)
from .experiments.cheating import (
    trick_gains as trick_gains,
)
from .experiments.cheating import (
    trick_means as trick_means,
)
from .experiments.choreography import choreography_summary as choreography_summary
from .experiments.choreography import choreography_table as choreography_table
from .experiments.choreography import seam_jerk as seam_jerk
from .experiments.comparison import (
    comparison as comparison,
)
from .experiments.comparison import (
    long_table as long_table,
)
from .experiments.comparison import (
    side_by_side as side_by_side,
)
from .experiments.danced_feet import contact_table as contact_table
from .experiments.danced_feet import feet_of_dances as feet_of_dances
from .experiments.danced_feet import foot_curves as foot_curves
from .experiments.danced_feet import toe_curves as toe_curves
from .experiments.danced_feet import toe_variety as toe_variety
from .experiments.dancer_parts import recording_chain as recording_chain
from .experiments.default_dances import default_dances as default_dances
from .experiments.discrimination import (
    auc_table as auc_table,
)
from .experiments.discrimination import (
    compare_corpora as compare_corpora,
)
from .experiments.discrimination import (
    dance_patterns_of as dance_patterns_of,
)
from .experiments.discrimination import (
    dance_table as dance_table,
)
from .experiments.discrimination import (
    disturbance_table as disturbance_table,
)
from .experiments.discrimination import (
    pick_table as pick_table,
)
from .experiments.examples import example_recording as example_recording
from .experiments.examples import excerpt as excerpt
from .experiments.examples import waltz_example as waltz_example
from .experiments.feet import foot_table as foot_table
from .experiments.feet import foot_trials as foot_trials
from .experiments.generation import (
    VARIANTS as VARIANTS,
)
from .experiments.generation import (
    generator_corpora as generator_corpora,
)
from .experiments.generation import (
    histories as histories,
)
from .experiments.generation import (
    trained as trained,
)
from .experiments.guard import DOCTORED as DOCTORED
from .experiments.guard import guard_table as guard_table
from .experiments.guard import guard_verdicts as guard_verdicts
from .experiments.guard import song_dancer as song_dancer
from .experiments.half_minutes import MARKS as MARKS
from .experiments.half_minutes import half_minutes as half_minutes
from .experiments.half_minutes import machine_marks as machine_marks
from .experiments.half_minutes import right_music_table as right_music_table
from .experiments.judging import danced_unit as danced_unit
from .experiments.levels import (
    level_counts as level_counts,
)
from .experiments.levels import (
    level_recordings as level_recordings,
)
from .experiments.levels import (
    level_settings as level_settings,
)
from .experiments.levels import (
    level_table as level_table,
)
from .experiments.locked import (
    locked_table as locked_table,
)
from .experiments.locked import (
    statue_on_turntable as statue_on_turntable,
)
from .experiments.long_dances import (
    dance_limits as dance_limits,
)
from .experiments.long_dances import (
    danced_song as danced_song,
)
from .experiments.long_dances import (
    long_dances as long_dances,
)
from .experiments.memory import memory_table as memory_table
from .experiments.minutes import OURS as OURS
from .experiments.minutes import TEN_MINUTES as TEN_MINUTES
from .experiments.minutes import endurance_table as endurance_table
from .experiments.minutes import likeness_table as likeness_table
from .experiments.minutes import looked_at as looked_at
from .experiments.minutes import minutes as minutes
from .experiments.minutes import unheard as unheard
from .experiments.music2dance import DANCER_SETTINGS as DANCER_SETTINGS
from .experiments.music2dance import trained_dancer as trained_dancer
from .experiments.nulls import null_table as null_table
from .experiments.own_songs import own_songs as own_songs
from .experiments.own_songs import song_means as song_means
from .experiments.planted_truth import bow_table as bow_table
from .experiments.planted_truth import ceilings as ceilings
from .experiments.planted_truth import complete_table as complete_table
from .experiments.planted_truth import component_table as component_table
from .experiments.player_causes import cause_table as cause_table
from .experiments.player_causes import failure_words as failure_words
from .experiments.player_causes import usual_limits as usual_limits
from .experiments.player_cleaning import alignment_table as alignment_table
from .experiments.player_cleaning import cleaned_performance as cleaned_performance
from .experiments.player_cleaning import cleaning_summary as cleaning_summary
from .experiments.player_cleaning import cleaning_table as cleaning_table
from .experiments.player_cleaning import fault_examples as fault_examples
from .experiments.player_cleaning import planted_cleaning as planted_cleaning
from .experiments.player_cleaning import recorded_examples as recorded_examples
from .experiments.player_cleaning import tracked_players as tracked_players
from .experiments.player_frames import even_frames as even_frames
from .experiments.player_frames import music_scores as music_scores
from .experiments.player_frames import player_notice as player_notice
from .experiments.player_frames import predicted_pieces as predicted_pieces
from .experiments.player_frames import quantile_frames as quantile_frames
from .experiments.player_frames import tracked_pianist as tracked_pianist
from .experiments.player_frames import tracked_violinist as tracked_violinist
from .experiments.player_frames import worst_frames as worst_frames
from .experiments.player_modes import mode_over_epochs as mode_over_epochs
from .experiments.player_modes import random_inputs as random_inputs
from .experiments.player_pictures import delayed_steps as delayed_steps
from .experiments.player_pictures import played_clip as played_clip
from .experiments.player_pictures import player_boxes as player_boxes
from .experiments.player_pictures import point_modes as point_modes
from .experiments.player_pictures import untrained_player as untrained_player
from .experiments.player_scores import gains_table as gains_table
from .experiments.player_scores import hands_errors as hands_errors
from .experiments.player_scores import hits_table as hits_table
from .experiments.player_scores import piece_scores as piece_scores
from .experiments.player_tables import player_errors as player_errors
from .experiments.player_tables import rank_agreement as rank_agreement
from .experiments.player_tables import row_settings as row_settings
from .experiments.players import hands_data as hands_data
from .experiments.players import planted_data as planted_data
from .experiments.players import player_corpora as player_corpora
from .experiments.players import trained_player as trained_player
from .experiments.quality import (
    motion_measures as motion_measures,
)
from .experiments.quality import (
    motion_quality as motion_quality,
)
from .experiments.quality import (
    typical_unit as typical_unit,
)
from .experiments.standings import (
    difference_table as difference_table,
)
from .experiments.standings import (
    system_table as system_table,
)
from .experiments.standings import (
    table_by_dance as table_by_dance,
)
from .experiments.study import (
    agreement as agreement,
)
from .experiments.study import (
    beat_agreement as beat_agreement,
)
from .experiments.study import (
    clip_of_study as clip_of_study,
)
from .experiments.study import (
    pattern_of_study as pattern_of_study,
)
from .experiments.study import (
    readable_recordings as readable_recordings,
)
from .experiments.study import (
    strong_by_place as strong_by_place,
)
from .experiments.study import (
    study_recordings as study_recordings,
)
from .experiments.study import (
    synthetic_corpus as synthetic_corpus,
)
from .figures.ablation import (
    MEASURES as MEASURES,
)
from .figures.ablation import (
    ablation_figure as ablation_figure,
)
from .figures.ablation import (
    trade_off_figure as trade_off_figure,
)
from .figures.attributes import accuracy_figure as accuracy_figure
from .figures.attributes import classifier_figure as classifier_figure
from .figures.attributes import confusion_figure as confusion_figure
from .figures.attributes import probabilities_figure as probabilities_figure
from .figures.attributes import song_figure as song_figure
from .figures.avatars import depth_figure as depth_figure
from .figures.beats import (
    draw_curve as draw_curve,
)
from .figures.beats import (
    draw_hits as draw_hits,
)
from .figures.beats import (
    draw_marks as draw_marks,
)
from .figures.beats import (
    draw_tolerances as draw_tolerances,
)
from .figures.beats import score_figure as score_figure
from .figures.cheating import CHEAT_MEASURES as CHEAT_MEASURES
from .figures.cheating import listening_figure as listening_figure
from .figures.cheating import locked_figure as locked_figure
from .figures.cheating import tricks_figure as tricks_figure
from .figures.comparison import comparison_figure as comparison_figure
from .figures.dance import dance_figure as dance_figure
from .figures.feet import foot_model_figure as foot_model_figure
from .figures.feet import toes_figure as toes_figure
from .figures.feet import ways_figure as ways_figure
from .figures.framework import framework_figure as framework_figure
from .figures.framework import networks_figure as networks_figure
from .figures.listening import rates_figure as rates_figure
from .figures.listening import study_title as study_title
from .figures.meter import draw_meter as draw_meter
from .figures.meter import draw_places as draw_places
from .figures.motion import draw_frames as draw_frames
from .figures.motion import draw_poses as draw_poses
from .figures.music2dance import chain_figure as chain_figure
from .figures.music2dance import chance_figure as chance_figure
from .figures.music2dance import clusters_figure as clusters_figure
from .figures.music2dance import effectors_figure as effectors_figure
from .figures.music2dance import framework_boxes_figure as framework_boxes_figure
from .figures.music2dance import hands_figure as hands_figure
from .figures.music2dance import limits_figure as limits_figure
from .figures.music2dance import marks_figure as marks_figure
from .figures.player_overlays import onsets_figure as onsets_figure
from .figures.player_overlays import overlay_figure as overlay_figure
from .figures.player_overlays import points_figure as points_figure
from .figures.player_overlays import stills_figure as stills_figure
from .figures.player_points import cleaning_figure as cleaning_figure
from .figures.player_points import faults_figure as faults_figure
from .figures.player_points import features_figure as features_figure
from .figures.player_points import frames_figure as frames_figure
from .figures.player_points import modes_figure as modes_figure
from .figures.player_points import overview_figure as overview_figure
from .figures.player_points import player_network_figure as player_network_figure
from .figures.player_points import steps_figure as steps_figure
from .figures.player_results import components_figure as components_figure
from .figures.player_results import hits_figure as hits_figure
from .figures.player_results import mode_epochs_figure as mode_epochs_figure
from .figures.player_results import player_table_figure as player_table_figure
from .figures.player_results import random_inputs_figure as random_inputs_figure
from .figures.quality import distances_figure as distances_figure
from .figures.quality import sequences_figure as sequences_figure
from .figures.results import (
    auc_figure as auc_figure,
)
from .figures.results import (
    disturbances_figure as disturbances_figure,
)
from .figures.results import forced_choice_figure as forced_choice_figure
from .figures.results import (
    patterns_figure as patterns_figure,
)
from .figures.results import (
    picks_figure as picks_figure,
)
from .figures.sheets import contact_sheet as contact_sheet
from .figures.style import (
    COLOURS as COLOURS,
)
from .figures.style import (
    figure_style as figure_style,
)
from .figures.style import (
    save_figure as save_figure,
)
from .figures.style import (
    save_table as save_table,
)
from .figures.timing import offset_figure as offset_figure
from .figures.timing import timing_figure as timing_figure
from .figures.training import (
    VALIDATED as VALIDATED,
)
from .figures.training import (
    losses_figure as losses_figure,
)
from .figures.training import (
    validation_figure as validation_figure,
)
from .figures.variants import LOOKS as LOOKS
from .figures.verdicts import levels_figure as levels_figure
from .figures.verdicts import nulls_figure as nulls_figure
from .figures.verdicts import shape_speed_figure as shape_speed_figure
from .listening.analysis import (
    agreement_row as agreement_row,
)
from .listening.analysis import (
    answer_grid as answer_grid,
)
from .listening.analysis import (
    rater_rows as rater_rows,
)
from .listening.analysis import (
    score_rows as score_rows,
)
from .listening.analysis import (
    version_rows as version_rows,
)
from .listening.answers import Answers as Answers
from .listening.answers import merge as merge
from .listening.corpus_study import lagged_pieces as lagged_pieces
from .listening.folders import answer_files as answer_files
from .listening.folders import answer_log as answer_log
from .listening.folders import write_study as write_study
from .listening.marks import mark_rows as mark_rows
from .listening.presenting import StudyServer as StudyServer
from .listening.raters import SimulatedRater as SimulatedRater
from .listening.trials import Item as Item
from .listening.trials import make_key as make_key
from .listening.trials import make_trials as make_trials
from .profile import RunProfile as RunProfile
from .render.points import render_points as render_points
from .render.stick import moving_box as moving_box
from .render.stick import render_skeleton as render_skeleton
from .render.stills import avatar_stills as avatar_stills
from .render.video import write_dance as write_dance
from .timing.avatar_players import avatar_player as avatar_player
from .timing.film_readings import film_readings as film_readings
from .timing.movement import find_offset as find_offset
from .timing.page import dance_player as dance_player
from .timing.page import save_page as save_page
from .timing.performance import explain_performance as explain_performance
from .timing.performance import load_performance as load_performance
from .timing.performed import Performed as Performed
from .timing.performed import performed as performed
from .timing.performed import save_performed as save_performed
from .timing.playing import explain_playing as explain_playing
from .timing.playing import playing_findings as playing_findings
from .timing.playing_page import playing_player as playing_player
from .timing.playing_page import save_playing_page as save_playing_page
from .widgets.evaluation_page import write_evaluation as write_evaluation
from .widgets.labs.corpus import corpus_lab as corpus_lab
from .widgets.labs.detector import detector_lab as detector_lab
from .widgets.labs.meter import meter_lab as meter_lab
from .widgets.labs.pages import write_lab_pages as write_lab_pages
from .widgets.labs.saliency import saliency_lab as saliency_lab
from .widgets.labs.scoring import scoring_lab as scoring_lab
from .widgets.own_files import OwnFiles as OwnFiles
from .widgets.player import Dancer as Dancer
from .widgets.player import Player as Player
from .widgets.player import blind_page as blind_page
