"""models.poses: the torch twin of the motion coding, and bones that keep their lengths."""

import numpy as np
import torch

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import TANG_23
from harmolab.systems.training.layers import decode, fix_bones
from harmolab.systems.training.motion_code import decode_motion


def test_decoding_agrees_with_the_numpy_one(rng: np.random.Generator):
    code = rng.normal(size=(3, 40, 72))
    for batched, alone in zip(decode(torch.from_numpy(code), fps=15.0).numpy(), code, strict=True):
        np.testing.assert_allclose(batched, decode_motion(alone, 15.0, TANG_23), atol=1e-9)


def test_decoding_has_the_gradient_it_should(rng: np.random.Generator):
    code = torch.from_numpy(rng.normal(size=(2, 4, 9))).requires_grad_()
    assert torch.autograd.gradcheck(lambda values: decode(values, 5.0), (code,))


def test_bones_get_their_lengths_and_keep_their_directions():
    chain = torch.tensor([[0.0, 1, 0], [0, 3, 0], [0, 3, 3]])[None, None]
    fixed = fix_bones(chain, (-1, 0, 1), torch.tensor([0.0, 1.0, 0.5]))
    torch.testing.assert_close(fixed[0, 0], torch.tensor([[0.0, 1, 0], [0, 2, 0], [0, 2, 0.5]]))


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
