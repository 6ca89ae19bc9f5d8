"""The force of a haptic device stays passive, whatever models of tissue arrive."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("websockets")

from trocar.teleop import Coupling, DeviceProperties, LocalModel, Renderer
from trocar.teleop.bench import measure
from trocar.teleop.render import FADE_S, LIFE_S, positive
from trocar.teleop.rotation import IDENTITY, between, from_vector, matrix, multiply
from trocar.teleop.simulated import DEVICE, SimulatedDevice, Trial

#: Energy that rounding may make (J).
ROUNDING = 1e-9


def model(force=0.0, stiffness=0.0, seq=1):
    """Tissue that pushes along z."""
    wrench, matrix6 = np.zeros(6), np.zeros((6, 6))
    wrench[2], matrix6[2, 2] = force, stiffness
    return LocalModel(np.zeros(3), IDENTITY, wrench, matrix6, seq)


@pytest.mark.parametrize("delay", [0, 1, 5, 30])
def test_the_coupling_keeps_to_the_condition_of_colgate_and_schenkel(delay):
    """b > T/2 / (1 - cos wT) Re((1 - e^-jwT) H), their equation (22), for all frequencies."""
    device = replace(DEVICE, delay=delay * 1e-3)
    coupling, sample = Coupling.of(device), device.sample_time
    w = np.linspace(1e-3, np.pi, 20000) / sample
    z = np.exp(-1j * w * sample)
    spring = coupling.stiffness * z**delay
    needed = 0.5 * sample / (1.0 - np.cos(w * sample)) * ((1.0 - z) * spring).real
    assert needed.max() <= coupling.paid * (1.0 + 1e-6) <= device.damping
    assert needed.max() > 0.999 * coupling.paid


def test_properties_that_no_device_has_are_refused():
    for wrong in ({"mass": 0.0}, {"damping": -1.0}, {"delay": 1.0}, {"inertia": 0.0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            replace(DEVICE, **wrong)


@pytest.mark.parametrize("kind", ["press", "hold"])
@pytest.mark.parametrize("modulus", [3e3, 1e5, 1e6])
@pytest.mark.parametrize(("link", "loop"), [(1e-3, 1e-3), (0.03, 1e-3), (0.01, 0.03)])
def test_hand_and_tissue_stay_passive(kind, modulus, link, loop):
    """Three messages of ten are lost."""
    device = replace(DEVICE, delay=loop)
    # What is left of a slow device's friction stops it later.
    duration = 3.4 if loop > 0.01 else 2.6
    trial = Trial(0.01 * modulus, kind, link, 0.3, device, duration_s=duration, release_s=1.4)
    log = trial.run()
    assert max(log.active) < ROUNDING
    assert np.abs(np.array(log.place)[:, :3]).max() < 0.03
    # After the hand lets go nothing gains energy, and all of it decays.
    free = np.array(log.time) >= trial.release_s
    moving = np.array(log.moving)[free]
    before = moving[0] + np.array(log.tissue)[free][0]
    force = np.linalg.norm(np.array(log.rendered)[free][0][:3])
    assert moving.max() < before + 0.5 * force**2 / log.coupling.stiffness + ROUNDING
    assert moving[-1] < 0.01 * moving.max() + 1e-6
    assert log.tissue[-1] < 0.05 * max(log.tissue) + 1e-6
    # It was no still life.
    assert np.abs(np.array(log.rendered)[:, 2]).max() > 0.1


def test_the_force_as_it_arrives_is_not_passive():
    """What the library is for, and that these tests can fail."""
    for kind in ("press", "hold"):
        log = Trial(1e4, kind, 0.01, naive=True, duration_s=1.0).run()
        assert max(log.active) > 0.01


def test_soft_tissue_is_felt_as_it_is():
    """Within a tenth of its force without delay, and stiff tissue as the coupling."""
    soft = measure(Trial(30.0, "hold", 0.01))
    assert soft.ideal_error < 0.1 * soft.ideal
    assert soft.error < 0.2 * soft.tissue
    stiff = measure(Trial(1e4, "hold", 0.01))
    assert stiff.ideal_error < 0.1 * stiff.ideal


def test_no_model_at_all_makes_the_hand_gain_energy():
    """Not even random ones, of stiffnesses and forces that no tissue has."""
    dice = np.random.default_rng(3)
    for loop in (0.0, 1e-3, 0.02):
        properties = replace(DEVICE, delay=loop)
        device, renderer = SimulatedDevice(properties), Renderer(properties)
        felt = 0.0
        for k in range(3000):
            if k % 16 == 0 and dice.random() < 0.8:
                root = dice.normal(size=(6, 6)) * 10.0 ** dice.uniform(-1, 2.5)
                root[3:] *= 0.01
                wrench = (
                    dice.normal(size=6) * 10.0 ** dice.uniform(-2, 2) * [1, 1, 1, 0.01, 0.01, 0.01]
                )
                where = 0.01 * dice.normal(size=3)
                turned = from_vector(0.1 * dice.normal(size=3))
                news = LocalModel(where, turned, wrench, root @ root.T, 1, (0.5 * where, IDENTITY))
                renderer.update(news if dice.random() < 0.9 else None)
            position, rotation = device.read()
            wish = None
            if k < 2000:
                wish = 0.01 * np.sin(k * np.array([0.01, 0.013, 0.017, 0.03, 0.02, 0.01]))
            rendered = renderer.step(position, rotation)
            felt = max(felt, np.linalg.norm(rendered[:3]))
            device.advance(rendered, wish)
            # Forces under way when the energy is spent are the only excess.
            assert device.active < ROUNDING + 1e-3 * (loop > 0.0)
        assert felt > 0.1
        assert device.moving < 1e-6


def test_a_new_model_changes_the_force_continuously():
    renderer = Renderer(DEVICE)
    renderer.update(model(0.0, 200.0))
    # The hand presses: energy for later.
    for k in range(100):
        before = renderer.step(np.array([0.0, 0.0, -1e-4 * k]))
    assert before[2] > 1.0
    renderer.update(model(3.0, 400.0), (np.array([0.0, 0.0, -0.01]), IDENTITY))
    after = renderer.step(np.array([0.0, 0.0, -0.01]))
    assert abs(after[2] - before[2]) < 3.0 * 1e-3 / FADE_S + 0.05


def test_the_force_ends_with_the_news():
    renderer = Renderer(DEVICE)
    renderer.update(model(0.0, 200.0))
    for k in range(100):
        wrench = renderer.step(np.array([0.0, 0.0, -1e-4 * k]))
    felt = wrench[2]
    assert felt > 1.0
    still = np.array([0.0, 0.0, -0.01])
    steps = round(LIFE_S * 1e3)
    forces = [renderer.step(still)[2] for _ in range(steps + 30)]
    assert forces[steps - 110] > 0.9 * felt
    assert all(b <= a + 1e-12 for a, b in pairwise(forces))
    assert abs(forces[-1]) < 0.01 * felt


def test_the_force_has_the_limits_of_the_device():
    renderer = Renderer(replace(DEVICE, max_torque=0.0, max_force=1.0))
    renderer.update(model(0.0, 1e4))
    for k in range(100):
        wrench = renderer.step(
            np.array([0.0, 0.0, -1e-4 * k]), from_vector(np.array([0.001 * k, 0, 0]))
        )
    assert np.isclose(wrench[2], 1.0) and not wrench[3:].any()


def test_scaled_motion_and_force_have_the_same_power():
    """A tip that moves half as far, with half the force: the stiffness of a quarter."""
    stiff = DeviceProperties(mass=10.0, damping=1000.0, max_force=100.0)
    for scale, gain, expected in ((1.0, 1.0, 100.0), (0.5, 0.5, 25.0), (0.5, 1.0, 50.0)):
        renderer = Renderer(stiff, scale=scale, gain=gain)
        renderer.update(model(0.0, 100.0))
        for k in range(100):
            wrench = renderer.step(np.array([0.0, 0.0, -1e-4 * k]))
        assert np.isclose(wrench[2] / 0.0099, expected, rtol=0.01)


def test_stiffness_is_made_positive():
    wrong = np.diag([1.0, -1e-6, 3.0, 0.0, -1e-9, 1e-3])
    wrong[0, 1] = 1e-9
    values = np.linalg.eigvalsh(positive(wrong))
    assert values.min() > -1e-12 and np.isclose(values.max(), 3.0)


def test_rotations():
    dice = np.random.default_rng(0)
    for _ in range(20):
        a, b = (from_vector(dice.normal(size=3)) for _ in range(2))
        assert np.allclose(matrix(multiply(a, b)), matrix(a) @ matrix(b))
        again = multiply(from_vector(between(a, b)), a)
        assert np.allclose(again, b * np.sign(b @ again))
    assert np.allclose(
        between(IDENTITY, from_vector(np.array([1e-6, 0, 0]))), [1e-6, 0, 0], atol=1e-12
    )
