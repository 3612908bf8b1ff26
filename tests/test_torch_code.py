"""models.poses: the torch twin of the motion coding, and bones that keep their lengths."""

import math

import numpy as np
import pytest
import torch

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import TANG_23
from harmolab.systems.training.layers import decode, fix_bones, local_joints, root_path
from harmolab.systems.training.motion_code import decode_motion


def code_of(path: list[list[float]]) -> torch.Tensor:
    """One clip of one joint at height 1, with these rates (side, forward, yaw) in every frame."""
    joint = torch.tensor([0.0, 1.0, 0.0]).expand(len(path), 3)
    return torch.cat([joint, torch.tensor(path)], dim=1)[None]


def moved_by_hand(local: np.ndarray, parents: tuple[int, ...], lengths: np.ndarray) -> np.ndarray:
    """One frame, joint by joint: each is put at its length from its parent, in the direction it had."""
    fixed: dict[int, np.ndarray] = {}
    while len(fixed) < len(parents):
        for joint, parent in enumerate(parents):
            if parent < 0:
                fixed[joint] = local[joint]
            elif parent in fixed:
                bone = local[joint] - local[parent]
                fixed[joint] = fixed[parent] + bone / np.linalg.norm(bone) * lengths[joint]
    return np.stack([fixed[joint] for joint in range(len(parents))])


def test_walking_forward_goes_along_z():
    world = decode(code_of([[0.0, 2.0, 0.0]] * 3), fps=10.0)
    torch.testing.assert_close(world[0, :, 0], torch.tensor([[0, 1, 0], [0, 1, 0.2], [0, 1, 0.4]]))


def test_after_a_quarter_turn_to_the_left_forward_goes_along_x():
    quarter = math.pi / 2 * 10
    path, heading = root_path(code_of([[0.0, 0.0, 0.0], [0.0, 0.0, quarter], [0.0, 2.0, 0.0]]), fps=10.0)
    torch.testing.assert_close(heading[0], torch.tensor([0.0, math.pi / 2, math.pi / 2]))
    torch.testing.assert_close(path[0, 2], torch.tensor([0.2, 0.0]), atol=1e-6, rtol=0)


def test_a_turned_dancer_is_turned_in_the_world():
    code = code_of([[0.0, 0.0, 0.0], [0.0, 0.0, math.pi / 2]])
    code[..., :3] = torch.tensor([1.0, 0.5, 3.0])  # to the left, up, forward
    torch.testing.assert_close(decode(code, fps=1.0)[0, :, 0], torch.tensor([[1.0, 0.5, 3.0], [3.0, 0.5, -1.0]]))


def test_rates_of_the_first_frame_say_nothing():
    still = code_of([[0.0, 0.0, 0.0], [0.0, 1.0, 0.5]])
    moved = still.clone()
    moved[0, 0, -3:] = 9.0
    assert torch.equal(decode(still, 15.0), decode(moved, 15.0))


def test_decoding_agrees_with_the_numpy_one(rng: np.random.Generator):
    code = rng.normal(size=(3, 40, 72))
    for batched, alone in zip(decode(torch.from_numpy(code), fps=15.0).numpy(), code, strict=True):
        np.testing.assert_allclose(batched, decode_motion(alone, 15.0, TANG_23), atol=1e-9)


def test_decoding_has_the_gradient_it_should(rng: np.random.Generator):
    code = torch.from_numpy(rng.normal(size=(2, 4, 9))).requires_grad_()
    assert torch.autograd.gradcheck(lambda values: decode(values, 5.0), (code,))


def test_local_joints_are_the_first_channels():
    assert local_joints(torch.arange(9.0)[None, None]).tolist() == [[[[0, 1, 2], [3, 4, 5]]]]


def test_bones_get_their_lengths_and_keep_their_directions():
    chain = torch.tensor([[0.0, 1, 0], [0, 3, 0], [0, 3, 3]])[None, None]
    fixed = fix_bones(chain, (-1, 0, 1), torch.tensor([0.0, 1.0, 0.5]))
    torch.testing.assert_close(fixed[0, 0], torch.tensor([[0.0, 1, 0], [0, 2, 0], [0, 2, 0.5]]))


@pytest.mark.parametrize("parents", [TANG_23.parents, (2, 0, -1, 1, -1, 4)], ids=["tang", "children first, two roots"])
def test_fixing_bones_agrees_with_joint_by_joint(rng: np.random.Generator, parents: tuple[int, ...]):
    local, lengths = rng.normal(size=(2, 3, len(parents), 3)), rng.uniform(0.1, 1, len(parents))
    fixed = fix_bones(torch.from_numpy(local), parents, torch.from_numpy(lengths)).numpy()
    for ours, frame in zip(fixed.reshape(6, -1, 3), local.reshape(6, -1, 3), strict=True):
        np.testing.assert_allclose(ours, moved_by_hand(frame, parents, lengths), atol=1e-6)


def test_joints_without_bones_stay_where_they_are(rng: np.random.Generator):
    local = torch.from_numpy(rng.normal(size=(1, 2, 4, 3)))
    assert torch.equal(fix_bones(local, Skeleton.unnamed(4).parents, torch.ones(4)), local)


def test_fixing_bones_has_the_gradient_it_should(rng: np.random.Generator):
    local = torch.from_numpy(rng.normal(size=(1, 2, 4, 3))).requires_grad_()
    lengths = torch.tensor([0.0, 1.0, 0.5, 0.25], dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda values: fix_bones(values, (-1, 0, 1, 0), lengths), (local,))


def test_a_bone_of_no_length_has_a_finite_gradient():
    local = torch.zeros(1, 1, 2, 3, requires_grad=True)
    fixed = fix_bones(local, (-1, 0), torch.tensor([0.0, 1.0]))
    fixed.sum().backward()
    assert fixed.isfinite().all() and local.grad.isfinite().all()
