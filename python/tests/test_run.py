"""Chains, runs, and runs made step by step."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import beadline as bl


def short(**more: Any) -> bl.Run:
    """100 beads with a light impurity; some 1400 steps."""
    chain = bl.Chain(beads=100, mass_kg=1e-3, alpha=1.5, stiffness=1e7, impurities={50: 0.6e-3})
    return bl.Run(chain, strikers={0: 5.0}, duration_s=2e-3, **more)


def test_a_run_says_what_it_is() -> None:
    run = short(name="light")
    assert (run.name, run.steps) == ("light", run.manifest["physics"]["step_count"])
    # L and T of m = 1 g, k = 1e7 N/m^1.5, v0 = 5 m/s: the reference's, to its 8 digits
    assert run.collision_length_m == pytest.approx(0.36238983e-3, rel=1e-7)
    assert run.collision_time_s == pytest.approx(72.477966e-6, rel=1e-7)


def test_every_rule_of_a_configuration_can_be_said() -> None:
    chain = bl.Chain(
        6,
        mass_kg=[1e-3, 2e-3, 1e-3, 2e-3, 1e-3, 4e-3],
        alpha=1.5,
        stiffness=np.linspace(1e7, 2e7, 5),
        contacts={2: 3e7},
        right="fixed",
        right_stiffness=5e7,
        gravity_m_s2=9.81,
        precompression_n=0.5,
        restitution=0.9,
    )
    rec = bl.Run(chain, strikers={0: 0.1}, duration_s=1e-4).simulate()
    assert rec.mass_kg.tolist() == [1e-3, 2e-3, 1e-3, 2e-3, 1e-3, 4e-3]
    assert rec.stiffness[[0, 2, 4]].tolist() == [1e7, 3e7, 2e7]
    assert rec.manifest["physics"]["method"] == "rk5"
    assert np.all(np.diff(rec.rest_force_n) > 0), "each contact carries one bead more"
    rules = bl.Chain(
        6, mass_kg=1e-3, alpha=1.5, stiffness=1e7, masses={"taper": 0.5}, stiffnesses="radii"
    )
    assert bl.Run(rules, strikers={0: 1.0}, duration_s=1e-4).simulate().mass_kg[1] == 0.5e-3


def test_a_thermal_run_that_goes_on_is_told_of_the_same_noise() -> None:
    chain = bl.Chain(6, mass_kg=1.0, bonds={"linear": 1.0}, left="fixed", right="fixed", disorder=[{"of": "masses", "uniform": 0.1}])
    bath = {"beads": "..", "temperature_j": 1.0, "friction_per_s": 0.5}
    run = bl.Run(chain, baths=[bath], initial={"thermal": {"energy_j": 0.5}}, seed=5, duration_s=60.0, dt_s=0.02)
    state = run.simulate()[-1]
    with pytest.warns(RuntimeWarning, match="same noise again"):
        same = run.starting_from(state).simulate()
    assert np.allclose(same[-1].velocity_m_s, state.velocity_m_s, atol=1e-3), "the noise has made it forget its beginning"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        other = run.starting_from(state, seed=6)
    assert np.abs(other.simulate()[-1].velocity_m_s - state.velocity_m_s).max() > 0.1
    assert (other.simulate().mass_kg == same.mass_kg).all()


def test_a_key_is_names_and_numbers_and_a_value_stays_the_callers() -> None:
    run = short()
    for key in ("chain..alpha", "[chain]alpha", "chain.alpha.", ""):
        with pytest.raises(bl.ConfigError, match="found the key '.*'; expected names with points"):
            run.replace({key: 2.0})
    own = [{"bead": 3, "mass_kg": 1e-3}]
    run.replace({"chain.impurities": own, "chain.impurities[0].mass_kg": 9e-3})
    assert own == [{"bead": 3, "mass_kg": 1e-3}]
    for values in ({"seed": 2**64}, {"chain.masses": {"list_kg": [1.0, None]}}):
        with pytest.raises(bl.ConfigError, match=r"^(seed|list_kg): found .*; expected a number"):
            run.replace(values)
    with pytest.raises(TypeError, match="chain: found 3; expected a beadline.Chain"):
        bl.Run(3, duration_s=1.0)  # type: ignore[arg-type]


def test_what_cannot_be_is_refused_with_its_key_and_no_line_that_nobody_wrote() -> None:
    wrong = bl.Chain(10, mass_kg=1, alpha=0.5, stiffness=1)
    with pytest.raises(bl.ConfigError, match=r"^chain.alpha: found 0.5; allowed: ") as found:
        bl.Run(wrong, strikers={0: 1.0}, duration_s=1)
    assert (found.value.key, found.value.line) == ("chain.alpha", None)
    chain = bl.Chain(10, mass_kg=1, alpha=2, stiffness=1)
    with pytest.raises(TypeError, match="strikers: found 5.0; expected numbers and values, such as"):
        bl.Run(chain, strikers=5.0, duration_s=1)  # type: ignore[arg-type]


def test_a_text_is_read_with_its_lines() -> None:
    with pytest.raises(bl.ConfigError, match="line 3: chain.foo: found the unknown key") as raised:
        bl.Run.from_toml("[chain]\nbeads = 3\nfoo = 1\n")
    assert raised.value.line == 3


def test_a_configuration_file_is_read_with_its_lines(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(short().to_toml())
    assert bl.Run.from_toml(path).name == "mine"
    assert bl.Run.from_toml(str(path)).manifest["physics"] == short().manifest["physics"]
    path.write_text(short().to_toml().replace("beads = 100", "beads = 1"))
    with pytest.raises(bl.ConfigError, match=r"mine.toml:2: chain.beads") as found:
        bl.Run.from_toml(path)
    assert (found.value.line, found.value.path) == (2, str(path))


def test_presets_are_those_of_the_command_and_can_be_changed() -> None:
    assert "light-impurity" in bl.presets()
    run = bl.preset("light-impurity").replace(
        {"time.duration_s": 1e-3, "chain.impurities[0].mass_kg": 2e-3}
    )
    assert run.manifest["physics"]["impurities"] == [{"bead": 500, "mass_kg": 2e-3}]
    with pytest.raises(KeyError, match="light-impurity"):
        bl.preset("light")
    with pytest.raises(bl.ConfigError, match="no such key"):
        run.replace({"chain.impurities[7].mass_kg": 1.0})
    with pytest.raises(bl.ConfigError, match=r"^striker\[0\].velocity_m_s: found the number 0 where there is no list; allowed"):
        run.replace({"striker[0].velocity_m_s": 1.0})
    for make in (run.replace, bl.Run.from_config):
        with pytest.raises(TypeError, match="found 5; expected"):
            make(5)  # type: ignore[arg-type]


def test_a_run_recorded_in_memory_and_step_by_step_has_the_same_bits(tmp_path: Path) -> None:
    run = short()
    recorded, kept, sim = run.record(tmp_path / "a.mcap"), run.simulate(every=64), run.start()
    velocity, displacement = sim.velocity_m_s, sim.displacement_m
    while not sim.is_done:
        state = recorded[sim.step(100).step_number]
        assert np.array_equal(velocity, state.velocity_m_s)
        assert np.array_equal(displacement, kept[sim.step_number].displacement_m)
    assert (sim.time_s, sim.step_number) == (recorded[-1].time_s, run.steps)
    copy = sim.state().velocity_m_s
    assert not velocity.flags.writeable and not np.shares_memory(copy, velocity)
    assert sim.step(10).step_number == run.steps, "there are no more"


def test_a_callback_sees_frames_and_ends_the_run(tmp_path: Path) -> None:
    seen: list[int] = []

    def until_bead_20_moves(state: bl.State) -> bool:
        seen.append(state.step)
        return bool(state.velocity_m_s[20] > 1.0)

    path = tmp_path / "a.mcap"
    rec = short().record(path, on_frame=until_bead_20_moves, on_frame_every=10)
    assert rec.about["end"] == "interrupted" and rec.last_step == seen[-1]
    assert seen == list(range(0, seen[-1] + 1, 10))
    assert rec[-1].velocity_m_s[20] > 1.0 >= rec[-11].velocity_m_s[20]


def test_what_a_callback_raises_ends_the_run_in_order(tmp_path: Path) -> None:
    def fails(state: bl.State) -> None:
        if state.step == 300:
            raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        short().record(tmp_path / "a.mcap", on_frame=fails)
    assert bl.open(tmp_path / "a.mcap").last_step == 300
    with pytest.raises(ZeroDivisionError, match="mine"):
        short().simulate(on_frame=fails)


def test_a_file_is_not_replaced_without_a_word(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    short().record(path)
    with pytest.raises(FileExistsError, match="exists"):
        short().record(path)
    assert short().record(path, force=True, every=50).record_every == 50
    with pytest.raises(ValueError, match="wait_for: found 1; expected 0, or publish=True"):
        short().record(path, force=True, wait_for=1)
    for every in (0, -1):
        with pytest.raises(ValueError, match=f"every: found {every}; expected 1 or more"):
            short().record(path, force=True, every=every)
    with pytest.raises(FileNotFoundError):
        short().record(tmp_path / "nowhere" / "a.mcap")


def test_values_that_are_no_longer_finite_end_a_run() -> None:
    # the longest step that is taken resolves a contact, but this method gains energy with it
    chain = bl.Chain(10, mass_kg=1e-3, alpha=1.5, stiffness=1e7, left="fixed", right="fixed")
    strikes = bl.Run(chain, strikers={0: 5.0}, duration_s=1.0, dt_s=1.8e-5, method="gear5")
    with pytest.raises(bl.RunError, match="not finite at step .* smaller dt"):
        strikes.simulate()
    with pytest.raises(bl.RunError, match="not finite"):
        strikes.start().step(100_000)


def test_runs_side_by_side_have_the_bits_of_each_alone() -> None:
    numbers = np.random.default_rng(7)

    def run_of(kind: int, seed: int) -> bl.Run:
        beads, mass_kg = 4 + 3 * kind, (1e-3 * numbers.uniform(0.5, 2.0, 4 + 3 * kind)).tolist()
        ends: dict[str, Any] = [{}, {"left": "fixed", "right": "fixed", "precompression_n": 3.0}, {"left": "periodic", "right": "periodic"}][kind % 3]
        more: dict[str, Any] = {}
        if kind == 3:
            more["baths"] = [{"beads": "..2", "temperature_j": 1e-6, "friction_per_s": 1e3}]
        if kind == 4:
            # computed alone
            more["drives"] = [{"bead": 1, "force_n": {"sine": {"amplitude": 1.0, "frequency_hz": 1e4}}}]
        chain = bl.Chain(beads, mass_kg=mass_kg, alpha=1.5 + 0.5 * (kind % 2), stiffness=1e7 * numbers.uniform(0.5, 2.0), **ends)
        # of different lengths, so that lanes end one after the other; published less often than every step
        duration_s = 1e-4 * numbers.uniform(0.5, 1.5)
        struck = {seed % beads: numbers.uniform(0.1, 1.0)}
        return bl.Run(chain, strikers=struck, seed=seed, duration_s=duration_s, publish_every=1 + seed % 3, **more)

    runs = [run_of(kind, seed) for kind in range(6) for seed in range(11)]
    for every, jobs in ((1, 1), (7, 2), (5000, None)):
        found = bl.simulate(runs, every=every, jobs=jobs)
        for run, rec in zip(runs, found, strict=True):
            alone = run.simulate(every=every)
            assert rec.recorded_steps.tolist() == alone.recorded_steps.tolist()
            assert rec.summary == alone.summary
            for step in alone.recorded_steps.tolist():
                assert rec[step].displacement_m.tobytes() == alone[step].displacement_m.tobytes()
                assert rec[step].velocity_m_s.tobytes() == alone[step].velocity_m_s.tobytes()
            heard = run.simulate(every=every, on_frame=lambda _: False)
            assert np.array_equal(rec.velocity[1:9], heard.velocity[1:9])
            assert heard.recorded_steps.tolist() == alone.recorded_steps.tolist()
    assert bl.simulate([]) == []


def test_a_run_in_memory_keeps_states_that_are_published() -> None:
    assert short(publish_every=4).simulate(every=3).record_every == 4
    assert short(publish_every=4).simulate(every=9).record_every == 12
    again = short(publish_every=4).replace({"stream.publish_every_steps": 7})
    assert again.manifest["provenance"]["record_every_steps"] == 7


def test_a_run_of_several_that_cannot_be_is_named() -> None:
    chain = bl.Chain(10, mass_kg=1e-3, alpha=1.5, stiffness=1e7, left="fixed", right="fixed")
    strikes = bl.Run(chain, strikers={0: 5.0}, duration_s=1.0, dt_s=1.8e-5, method="gear5")
    runs = [strikes.replace({"time.duration_s": 1e-3}), short(), strikes]
    with pytest.raises(bl.RunError, match=r"^runs\[2\]: bead \d+ is not finite"):
        bl.simulate(runs)
    with pytest.raises(TypeError, match=r"^runs\[0\]: found 3; expected a beadline.Run"):
        bl.simulate([3])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="jobs: found 0; expected 1 or more"):
        bl.simulate([short()], jobs=0)


INTERRUPTED = """
import beadline as bl
chain = bl.Chain(beads=2000, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
def tell(state):
    if state.step == 0:
        print("begun", flush=True)
try:
    run = bl.Run(chain, strikers={0: 5.0}, duration_s=100.0)
    run.record("long.mcap", every=1000, on_frame=tell, on_frame_every=100000)
except KeyboardInterrupt:
    print("ended", flush=True)
"""


def test_ctrl_c_ends_a_recording_that_is_valid(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "begun\n"
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    assert (out, process.returncode) == ("ended\n", 0)
    rec = bl.open(tmp_path / "long.mcap")
    assert rec.about["end"] == "interrupted" and rec.about["is_finished"]


PUBLISHED = """
import beadline as bl
try:
    print("begun", flush=True)
    bl.preset("light-impurity").record("a.mcap", publish=True, wait_for=1)
except KeyboardInterrupt:
    print("ended", flush=True)
"""


def test_ctrl_c_ends_a_run_that_a_consumer_holds_back(tmp_path: Path) -> None:
    command = [sys.executable, "-c", PUBLISHED]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "begun\n"
    with bl.attach(timeout_s=20) as live:
        next(live)
        while live.behind < 10:
            pass
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=30)
        assert (out, process.returncode) == ("ended\n", 0)
        last = [frame.step for frame in live][-1]
        assert live.end == "interrupted"
    rec = bl.open(tmp_path / "a.mcap")
    # the frame on its way may have reached nobody
    assert rec.about["end"] == "interrupted" and rec.last_step in (last, last + 1)


def test_the_interpreter_goes_on_while_runs_are_made() -> None:
    chain = bl.Chain(beads=2000, mass_kg=1e-3, alpha=1.5, stiffness=1e7)
    run = bl.Run(chain, strikers={0: 5.0}, duration_s=0.2)
    made: list[bl.Recording] = []
    makers = [
        threading.Thread(target=lambda: made.append(run.simulate(every=1000))) for _ in range(2)
    ]
    for maker in makers:
        maker.start()
    turns = 0
    while any(maker.is_alive() for maker in makers):
        turns += 1
    for maker in makers:
        maker.join()
    assert turns > 1000, "this thread had its turns"
    one, other = made
    assert np.array_equal(one[-1].velocity_m_s, other[-1].velocity_m_s)


def test_tangents_are_the_change_of_the_last_state() -> None:
    chain = bl.Chain(8, mass_kg=1e-3, alpha=1.5, stiffness=1e7, left="fixed", right="fixed", precompression_n=20.0)
    velocities = [0.01, 0.0, -0.02, 0.0, 0.0, 0.01, 0.0, 0.0]

    def ended(change: float) -> np.ndarray:
        changed = [velocities[0], velocities[1] + change, *velocities[2:]]
        run = bl.Run(chain, initial=(np.zeros(8), changed), duration_s=1e-3, dt_s=1e-6)
        state = run.start().step(run.steps).state()
        return np.concatenate([state.displacement_m, state.velocity_m_s])

    run = bl.Run(chain, initial=(np.zeros(8), velocities), duration_s=1e-3, dt_s=1e-6)
    w0 = np.zeros(16)
    w0[9] = 1.0
    w = run.tangent(w0)
    assert np.allclose(w, (ended(1e-6) - ended(-1e-6)) / 2e-6, rtol=1e-6, atol=1e-9 * np.abs(w).max())
    both = run.tangent(np.array([w0, 2 * w0]))
    assert both.shape == (2, 16)
    assert (both == np.array([w, 2 * w])).all()
    with pytest.raises(ValueError, match="expected 16"):
        run.tangent(np.zeros(3))
    with pytest.raises(ValueError, match="carries no tangents"):
        _ = run.start().tangents


def test_derivatives_are_those_of_a_scaling_law() -> None:
    values = {"chain.beads": 20, "chain.impurities[0].bead": 5, "time.duration_s": 1e-3}
    run = bl.preset("light-impurity").replace(values)
    u = run.start().step(run.steps).state().displacement_m
    # stiffer and heavier by the same part is the same motion
    together = np.zeros(2 * u.size)
    for key in ("chain.stiffness", "chain.bead_mass_kg", "chain.impurities[0].mass_kg"):
        together += run._number(key) * run.derivative(key)
    assert np.abs(together[: u.size]).max() < 1e-6 * np.abs(u).max()
    rows = run.derivative("chain.stiffness", "chain.alpha")
    assert rows.shape == (2, 2 * u.size)
    with pytest.raises(ValueError, match="no such key"):
        run.derivative("chain.colour")
    with pytest.raises(ValueError, match="time.duration_s: found a number that changes no step"):
        run.derivative("time.duration_s")
    with pytest.raises(ValueError, match="expected a number other than 0"):
        run.derivative("integrator.method")
    with pytest.raises(ValueError, match="found no key"):
        run.derivative()
