"""The Python module, as a script uses it.

usage: python_test.py PROJECT PROGRAM      (with the module on PYTHONPATH)
"""

import gc
import ast
import inspect
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import unittest
import weakref
from pathlib import Path

import numpy as np

import moraine

PROJECT, PROGRAM = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
ENVIRONMENT = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", OMP_WAIT_POLICY="passive")


def box(**changes):
    """A few grains in a box, as Python values; `changes` replaces sections."""
    sections = {
        "title": "grains in a box",
        "domain": {"low": [0, 0, 0], "high": [0.1, 0.1, 0.2]},
        "time": {"end": 0.1, "step": 5e-5, "gravity": [0, 0, -9.81]},
        "material": [{"name": "glass", "density": 2500.0}],
        "contact": {"normal": "linear", "tangential": "spring",
                    "pair": [{"normal_stiffness": 1000.0, "restitution": 0.9, "friction": 0.4}]},
        "particles": [{"diameter": [0.01, 0.012], "velocity": [0.2, 0.1, -1.0],
                       "fill": {"region": {"box": {"low": [0, 0, 0], "high": [0.1, 0.1, 0.2]}}, "count": 120}}],
        "wall": [{"name": "box", "box": {"low": [0, 0, 0], "high": [0.1, 0.1, 0.2]}}],
    }
    sections.update(changes)
    return moraine.Scene(sections)


def one_grain(velocity=(0, 0, 0), **changes):
    free = {"domain": {"low": [0, 0, 0], "high": [1, 1, 1]}, "wall": [],
            "particles": [{"diameter": 0.01, "velocity": list(velocity), "fill": {"positions": [[0.5, 0.5, 0.5]]}}]}
    return box(**{**free, **changes})


def open_faces():
    return [{"name": face, "face": face} for face in ("x-low", "x-high", "y-low", "y-high", "z-low", "z-high")]


class Scenes(unittest.TestCase):
    def test_python_values_text_and_file_give_the_same_bits(self):
        by_values = moraine.Simulation(box(), threads=1)
        by_text = moraine.Simulation(moraine.Scene(box().text), threads=2)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "scene.toml"
            file.write_text(box().text)
            by_file = moraine.Simulation(moraine.Scene.from_file(file, {"run.skin": 0.001}), threads=1)
        for run in by_values, by_text, by_file:
            run.step(500)
        self.assertEqual(by_values.state_hash(), by_text.state_hash())
        self.assertEqual(by_values.state_hash(), by_file.state_hash())

    def test_every_problem_is_told_with_its_key_and_no_line_of_a_text_that_nobody_wrote(self):
        with self.assertRaises(moraine.SceneError) as caught:
            box(time={"end": -1.0, "stepp": 1e-5})
        keys = [problem.key for problem in caught.exception.problems]
        self.assertIn("time.stepp", keys)
        self.assertIn("time.end", keys)
        self.assertTrue(all(problem.line is None for problem in caught.exception.problems))
        self.assertIn('key "time.stepp"', str(caught.exception))
        self.assertIn("step", dict(zip(keys, (p.message for p in caught.exception.problems)))["time.stepp"])

    def test_a_text_s_problem_has_its_line(self):
        with self.assertRaises(moraine.SceneError) as caught:
            moraine.Scene("title = 'x'\nsurprise = 1\n")
        self.assertIn(("surprise", 2), [(p.key, p.line) for p in caught.exception.problems])

    def test_a_value_that_toml_cannot_have_is_named(self):
        with self.assertRaisesRegex(TypeError, r'key "time.end": a object cannot stand in a scene'):
            box(time={"end": object()})

    def test_numpy_values_odd_texts_and_numbers_survive(self):
        scene = box(title='a "quoted" \\ title\nwith ü', domain={"low": np.zeros(3), "high": np.array([0.1, 0.1, 0.2])},
                    time={"end": np.float64(0.1), "step": 5e-5, "gravity": (0, 0, -9.81)})
        self.assertEqual(scene.title, 'a "quoted" \\ title\nwith ü')
        self.assertEqual(scene.end, 0.1)

    def test_a_scene_that_cannot_be_filled_is_a_scene_error(self):
        with self.assertRaises(moraine.SceneError):
            moraine.Simulation(box(particles=[{"diameter": 0.01, "fill": {"positions": [[0.05, 0.05, 0.05]] * 2}}]))

    def test_changes_are_those_of_the_command_line(self):
        scene = moraine.Scene(box().text, changes={"time.end": 0.25, "domain.periodic": [True, False, False]})
        self.assertEqual(scene.end, 0.25)
        with self.assertRaises(moraine.SceneError):
            moraine.Scene(box().text, changes=["time.ende=1"])


class Arrays(unittest.TestCase):
    def setUp(self):
        self.run_ = moraine.Simulation(box(), threads=2)

    def test_each_field_has_the_shape_unit_and_type_of_the_table(self):
        run = self.run_
        self.assertEqual(run.fields["position"], ("m", (120, 3)))
        self.assertEqual(run.fields["inverse_mass"], ("1/kg", (120,)))
        for name, (_, shape) in run.fields.items():
            self.assertEqual(getattr(run, name).shape, shape)
        self.assertEqual(run.gid.dtype, np.uint64)
        self.assertEqual(run.material.dtype, np.uint16)
        np.testing.assert_allclose(1 / run.inverse_mass, 2500 * 4 / 3 * np.pi * run.radius**3, rtol=1e-14)

    def test_they_are_views_of_the_state_and_not_copies(self):
        run = self.run_
        first, second = run.position, run.position
        self.assertTrue(np.shares_memory(first, second))
        self.assertEqual(first.strides[0], 12 * 8)
        before = first.copy()
        while run.n_rebuilds == moraine.Simulation(box()).n_rebuilds and run.step_number < 3:
            run.step()
        self.assertFalse(np.array_equal(before, run.position))

    def test_they_can_only_be_read(self):
        with self.assertRaises(ValueError):
            self.run_.position[0, 0] = 0.0
        with self.assertRaises(ValueError):
            self.run_.position.flags.writeable = True

    def test_old_arrays_stay_sound_after_rebuilds_and_the_end_of_the_run(self):
        run = self.run_
        kept = []
        for _ in range(40):
            kept.append((run.position, run.gid, run.velocity[:, 2]))
            run.step(20)
        self.assertGreater(run.n_rebuilds, 3)
        position = run.position
        del run, self.run_
        gc.collect()
        for old, gid, vertical in kept:
            self.assertTrue(np.isfinite(old).all() and np.isfinite(vertical).all())
            self.assertEqual(sorted(gid), list(range(120)))
        self.assertTrue(((position > 0) & (position < 0.2)).all())

    def test_a_field_that_the_scene_does_not_need_is_named_with_the_cure(self):
        with self.assertRaisesRegex(KeyError, "output.fields"):
            self.run_.force
        with self.assertRaisesRegex(KeyError, "no field .*position"):
            self.run_.array("positions")

    def test_forces_where_the_scene_asks_for_them_obey_newton(self):
        run = moraine.Simulation(box(output={"fields": ["force"]}), threads=1)
        run.step(200)
        before, gid = run.velocity.copy(), run.gid.copy()
        rebuilds = run.n_rebuilds
        run.step()
        if run.n_rebuilds == rebuilds:
            gained = (run.velocity - before) / run.time_step
            np.testing.assert_allclose(gained, run.force * run.inverse_mass[:, None] + [0, 0, -9.81], atol=1e-6)

    def test_gathered_fields_are_in_order_of_gid(self):
        run = self.run_
        run.step(300)
        self.assertEqual(run.gather("gid").tolist(), list(range(120)))
        np.testing.assert_array_equal(run.gather("velocity")[run.gid], run.velocity)

    def test_those_who_have_left_are_not_in_the_arrays(self):
        run = moraine.Simulation(box(wall=[], outlet=open_faces()))
        while run.n_left == 0:
            run.step(10)
        self.assertTrue(np.isfinite(run.position).all())
        self.assertEqual(len(run.gid), run.n_grains)
        self.assertEqual(run.n_born, run.n_grains + run.n_left)


class Edits(unittest.TestCase):
    def test_a_changed_velocity_moves_the_grain_as_it_should(self):
        run = moraine.Simulation(one_grain(time={"end": 1.0, "step": 1e-4}))
        run.step(10)
        with run.edit() as state:
            state.velocity[:] = [0.1, 0.2, -0.3]
        place = run.position.copy()
        run.step(1000)
        np.testing.assert_allclose(run.position - place, [[0.01, 0.02, -0.03]], atol=1e-12)

    def test_grains_moved_by_hand_meet_their_new_neighbours(self):
        positions = [[0.2, 0.2, 0.2], [0.8, 0.8, 0.8]]
        run = moraine.Simulation(one_grain(time={"end": 1.0, "step": 1e-5},
                                           particles=[{"diameter": 0.01, "fill": {"positions": positions}}]))
        run.step(5)
        with run.edit() as state:
            state.position[:] = [[0.5, 0.5, 0.5], [0.5099, 0.5, 0.5]]
        run.step(1000)
        self.assertGreater(abs(run.velocity[0, 0]), 1e-3)
        np.testing.assert_allclose(run.velocity.sum(axis=0), 0, atol=1e-12)

    def test_an_edit_gives_the_same_bits_on_any_threads(self):
        hashes = set()
        for threads in 1, 3:
            run = moraine.Simulation(box(), threads=threads)
            run.step(150)
            with run.edit() as state:
                state.velocity[:] *= 1.5
            run.step(150)
            hashes.add(run.state_hash())
        self.assertEqual(len(hashes), 1)

    def test_a_place_outside_the_domain_is_refused_until_it_is_mended(self):
        run = moraine.Simulation(box())
        with self.assertRaisesRegex(ValueError, "gid .* outside the domain"):
            with run.edit() as state:
                old = state.position[7].copy()
                state.position[7] = [0, 0, 5]
        with self.assertRaisesRegex(moraine.RunError, "outside the domain"):
            run.step()
        with run.edit() as state:
            state.position[7] = old
        run.step()

    def test_not_a_number_is_refused(self):
        run = moraine.Simulation(box())
        with self.assertRaisesRegex(ValueError, "not a number"):
            with run.edit() as state:
                state.position[3] = np.nan

    def test_other_fields_cannot_be_changed_nor_any_after_the_edit(self):
        run = moraine.Simulation(box())
        with self.assertRaisesRegex(ValueError, "cannot be changed"):
            with run.edit() as state:
                state.radius[:] = 1
        with run.edit() as state:
            velocity = state.velocity
        with self.assertRaises(ValueError):
            velocity[:] = 0
        with self.assertRaises(RuntimeError):
            state.velocity


class Runs(unittest.TestCase):
    def test_run_ends_with_the_hash_of_the_command_line(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            (folder / "scene.toml").write_text(box(output={"snapshots": 0.05}, probe=[{"kind": "contacts", "interval": 0.01}]).text)
            done = subprocess.run([PROGRAM, "run", folder / "scene.toml", "--out", folder / "program", "--layout", "1x1"],
                                  capture_output=True, text=True, env=ENVIRONMENT)
            self.assertEqual(done.returncode, 0, done.stderr)
            run = moraine.Simulation(moraine.Scene.from_file(folder / "scene.toml"), out=folder / "script", threads=2)
            run.run()
            self.assertIn(run.state_hash(), done.stdout)
            for name in "contacts.csv", "hashes.csv":
                self.assertEqual((folder / "script" / name).read_text(), (folder / "program" / name).read_text())
            paths = moraine.snapshots(folder / "script")
            self.assertEqual([p.name for p in paths], [p.name for p in moraine.snapshots(folder / "program")])
            last = moraine.read(paths[-1])
            self.assertEqual(last.state_hash, run.state_hash())
            np.testing.assert_array_equal(last["position"], run.gather("position"))
            self.assertEqual(last.units["velocity"], "m/s")
            again = subprocess.run([PROGRAM, "info", folder / "script"], capture_output=True, text=True, env=ENVIRONMENT)
            self.assertEqual(again.returncode, 0, again.stderr)

    def test_a_run_goes_on_from_a_checkpoint_with_the_same_bits(self):
        whole = moraine.Simulation(box(), threads=1)
        whole.step(700)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "half.h5"
            half = moraine.Simulation(box(), threads=2)
            half.step(300)
            half.write_checkpoint(file)
            half.step(1)
            for other in (moraine.Simulation(box(), restart=file), moraine.Simulation.from_checkpoint(file, threads=3)):
                self.assertEqual(other.step_number, 300)
                other.step(400)
                self.assertEqual(other.state_hash(), whole.state_hash())
            with self.assertRaises(moraine.StorageError):
                moraine.read(Path(folder) / "nothing.h5")

    def test_callbacks_come_after_their_steps_and_can_stop_the_run(self):
        run, seen = moraine.Simulation(box()), []

        @run.every(50)
        def look(r):
            seen.append(r.step_number)
            if len(seen) == 3:
                r.stop()
        run.step(1000)
        self.assertEqual((seen, run.step_number), ([50, 100, 150], 150))
        run.forget(look)
        run.step(100)
        self.assertEqual(len(seen), 3)
        with self.assertRaises(ValueError):
            run.every(0, look)

    def test_what_a_callback_throws_comes_out_and_the_run_can_go_on(self):
        run = moraine.Simulation(box())
        run.every(10, lambda r: 1 / 0)
        with self.assertRaises(ZeroDivisionError):
            run.step(100)
        self.assertEqual(run.step_number, 10)

    def test_a_callback_cannot_step_its_own_run(self):
        run = moraine.Simulation(box())
        run.every(10, lambda r: r.step())
        with self.assertRaisesRegex(RuntimeError, "cannot step"):
            run.step(10)

    def test_an_interrupt_ends_it_after_a_whole_step_and_it_can_go_on(self):
        whole, run = moraine.Simulation(box(), threads=1), moraine.Simulation(box(), threads=1)
        threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            run.step(10**9)
        whole.step(run.step_number)
        self.assertEqual(whole.state_hash(), run.state_hash())
        run.step(10)

    def test_other_threads_run_meanwhile(self):
        counts, is_over = [0], threading.Event()

        def count():
            while not is_over.is_set():
                counts[0] += 1
                is_over.wait(0.001)
        thread = threading.Thread(target=count)
        thread.start()
        run = moraine.Simulation(box(), threads=1)
        before = counts[0]
        run.step(20000)
        is_over.set()
        thread.join()
        self.assertGreater(counts[0], before + 10)

    def test_a_run_that_explodes_is_a_run_error_that_names_the_grain(self):
        run = moraine.Simulation(one_grain())
        with run.edit() as state:
            state.velocity[:] = [0, 0, 1e4]
        with self.assertRaisesRegex(moraine.RunError, "grain"):
            run.step()
        with self.assertRaisesRegex(moraine.RunError, "has ended at step"):
            run.step()

    def test_probes_and_energies_are_those_of_the_scene(self):
        run = moraine.Simulation(box(output={"energy": True}, probe=[{"kind": "region", "name": "all", "interval": 0.01}]))
        run.step(100)
        self.assertEqual(run.probes, ["all"])
        self.assertEqual(run.probe("all")["grains"], 120)
        self.assertAlmostEqual(run.energy()["error"], 0, delta=1e-3 * run.energy()["total"])
        with self.assertRaisesRegex(KeyError, "it has all"):
            run.probe("none")

    def test_a_directory_that_holds_something_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "mine").write_text("x")
            with self.assertRaisesRegex(ValueError, "mine|holds|empty"):
                moraine.Simulation(box(), out=folder)

    def test_runs_are_freed(self):
        run = moraine.Simulation(box())
        gone = weakref.ref(run)
        del run
        gc.collect()
        self.assertIsNone(gone())


class BodyForces(unittest.TestCase):
    def test_a_constant_one_is_gravity_bit_for_bit(self):
        # 9.81 enters at another place of the sum, so only a grain without contacts can be the same in every bit
        script = moraine.Simulation(one_grain(time={"end": 1.0, "step": 1e-4}))
        script.set_body_force(lambda run: [0.0, 0.0, -9.81])
        scene = moraine.Simulation(one_grain(time={"end": 1.0, "step": 1e-4, "gravity": [0, 0, -9.81]}))
        script.step(500)
        scene.step(500)
        np.testing.assert_array_equal(script.position, scene.position)

    def test_a_spring_swings_with_its_period(self):
        run = moraine.Simulation(one_grain(time={"end": 10.0, "step": 1e-3}))
        with run.edit() as state:
            state.position[:] += [0.1, 0, 0]
        run.set_body_force(lambda r: -(2 * np.pi) ** 2 * (r.position - 0.5))
        run.step(1000)
        np.testing.assert_allclose(run.position, [[0.6, 0.5, 0.5]], atol=2e-6)
        run.set_body_force(None)
        velocity = run.velocity.copy()
        run.step(10)
        np.testing.assert_array_equal(run.velocity, velocity)

    def test_it_gives_the_same_bits_on_any_threads_and_enters_the_ledger(self):
        hashes = set()
        for threads in 1, 2, 3:
            run = moraine.Simulation(box(output={"energy": True}), threads=threads)
            run.set_body_force(lambda r: 5.0 * np.cross(r.velocity, [0, 0, 1.0]) + 3.0)
            run.step(400)
            hashes.add(run.state_hash())
            energy = run.energy()
            self.assertAlmostEqual(energy["error"], 0, delta=2e-3 * abs(energy["total"]))
        self.assertEqual(len(hashes), 1)

    def test_it_may_look_at_the_grains_only(self):
        for deed in (lambda r: r.step(), lambda r: r.state_hash(), lambda r: r.edit().velocity, lambda r: r.snapshot()):
            run = moraine.Simulation(box())
            run.set_body_force(deed)
            with self.assertRaises(RuntimeError):
                run.step()

    def test_it_goes_on_where_grains_leave_and_the_ledger_is_asked(self):
        run = moraine.Simulation(box(wall=[], outlet=open_faces(), output={"energy": True}))
        run.set_body_force(lambda r: 0.5 * r.velocity)
        while run.n_left < 20:
            run.step(10)
            run.energy()
        self.assertTrue(np.isfinite(run.position).all())

    def test_a_wrong_shape_and_an_error_in_it_come_out(self):
        for wrong, error in ((lambda r: np.zeros((3, 7)), ValueError), (lambda r: 1 / 0, ZeroDivisionError)):
            run = moraine.Simulation(box())
            run.set_body_force(wrong)
            with self.assertRaises(error):
                run.step()


def lid(**motion):
    """The box with a plane in it that a script moves."""
    return [{"name": "box", "box": {"low": [0, 0, 0], "high": [0.1, 0.1, 0.2]}},
            {"name": "lid", "plane": {"point": [0, 0, 0.19], "normal": [0, 0, -1]}, "motion": [{"type": "script", "max_speed": 0.5, **motion}]}]


class WallMotions(unittest.TestCase):
    def test_a_constant_velocity_is_the_scene_s_translation(self):
        told, in_scene = lid(), lid()
        in_scene[1]["motion"] = [{"type": "translate", "velocity": [0, 0, -0.4]}]
        script, scene = moraine.Simulation(box(wall=told)), moraine.Simulation(box(wall=in_scene))
        times = []

        def motion(time):
            times.append(time)
            return 0, 0, -0.4
        script.set_wall_motion("lid", motion, every=10)
        script.step(1000)
        scene.step(1000)
        np.testing.assert_allclose(times, (np.arange(100) + 0.5) * 10 * script.time_step, rtol=1e-12)
        self.assertLess(script.position[:, 2].max(), 0.18)
        np.testing.assert_allclose(script.gather("position"), scene.gather("position"), atol=1e-9)

    def test_it_gives_the_same_bits_on_any_threads_and_after_a_restart_and_a_restart_needs_it(self):
        def motion(time):
            return [0.0, 0.0, 0.3 * np.sin(60 * time)], [0.0, 0.5 * np.cos(20 * time), 0.0]
        walls = lid(origin=[0.05, 0.05, 0.0])
        walls[1]["plane"] = {"point": [0, 0, 0], "normal": [0, 0, 1]}  # a floor, that lifts grains
        scene = box(wall=walls, output={"energy": True})
        whole = moraine.Simulation(scene, threads=1)
        whole.set_wall_motion("lid", motion, 8)
        whole.step(300)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "half.h5"
            whole.write_checkpoint(file)  # between two calls
            whole.step(300)
            with self.assertRaisesRegex(moraine.RunError, 'wall "lid" is to be moved by a script.*after a restart as well'):
                moraine.Simulation(scene, restart=file).step()
            done = subprocess.run([PROGRAM, "run", "--restart", file, "scene.toml"], capture_output=True, text=True, env=ENVIRONMENT, cwd=folder)
            self.assertNotEqual(done.returncode, 0)
            (Path(folder) / "scene.toml").write_text(scene.text)
            for command in ["run"], ["run", "--restart", file], ["scale", "--strong"]:
                done = subprocess.run([PROGRAM, *command, "scene.toml"], capture_output=True, text=True, env=ENVIRONMENT, cwd=folder)
                self.assertEqual(done.returncode, 2, command)
                self.assertIn('wall "lid" is moved by a script', done.stderr)
                self.assertIn("run this scene from Python, also where a run goes on", done.stderr)
            done = subprocess.run([PROGRAM, "check", "scene.toml"], capture_output=True, text=True, env=ENVIRONMENT, cwd=folder)
            self.assertIn("lid (by a script: this scene is run from Python)", done.stdout)
            for threads in 1, 3:
                again = moraine.Simulation(scene, restart=file, threads=threads)
                again.set_wall_motion("lid", motion, 8)
                again.step(300)
                self.assertEqual(again.state_hash(), whole.state_hash())
                self.assertEqual(again.energy(), whole.energy())
        self.assertNotEqual(whole.energy()["wall_work"], 0)

    def test_what_cannot_be_is_said(self):
        for motion, error, text in ((lambda t: (0, 0, -1.0), moraine.RunError, "more than the max_speed"),
                                    (lambda t: (0, 0, np.nan), moraine.RunError, "not finite"), (lambda t: (1, 2), ValueError, "three numbers"),
                                    (lambda t: None, (ValueError, moraine.RunError), ""), (lambda t: 1 / 0, ZeroDivisionError, "")):
            run = moraine.Simulation(box(wall=lid()))
            run.set_wall_motion("lid", motion)
            with self.assertRaisesRegex(error, text):
                run.step()
        with self.assertRaisesRegex(moraine.RunError, "none has said how"):
            moraine.Simulation(box(wall=lid())).step()
        with self.assertRaisesRegex(ValueError, "there are: lid"):
            run.set_wall_motion("box", lambda t: (0, 0, 0))
        with self.assertRaisesRegex(ValueError, "none is"):
            moraine.Simulation(box()).set_wall_motion("box", lambda t: (0, 0, 0))
        run = moraine.Simulation(box(wall=lid()))
        run.set_wall_motion("lid", lambda t: run.state_hash())
        with self.assertRaisesRegex(RuntimeError, "neither can do anything else"):
            run.step()


RANKS_SCRIPT = """
{first}
import sys
import numpy as np
import moraine
scene = moraine.Scene(open(sys.argv[1]).read())
run = moraine.Simulation(scene, threads=1)
run.set_body_force(lambda r: 2.0 * np.cross(r.velocity, [0, 0, 1.0]))
seen = []
run.every(100, lambda r: seen.append(r.step_number))
run.step(250)
with run.edit() as state:
    state.velocity[:] *= 1.25
run.step(250)
assert seen == [100, 200, 300, 400, 500]
text = run.state_hash()
run.write_checkpoint(sys.argv[1] + ".h5")
gids = run.gather("gid")
assert (gids is None) == (moraine.rank() > 0)
if moraine.rank() == 0:
    assert gids.tolist() == list(range(120))
    print(moraine.size(), text)
{last}
"""


class Ranks(unittest.TestCase):
    def launch(self, n, text, *arguments, folder):
        script = Path(folder) / "script.py"
        script.write_text(text)
        return subprocess.run(["mpirun", "--oversubscribe", "-n", str(n), sys.executable, script, *arguments],
                              capture_output=True, text=True, env=ENVIRONMENT, timeout=120)

    def test_the_same_bits_on_one_and_three_ranks_with_and_without_mpi4py(self):
        variants = [(1, "", ""), (3, "", "")]
        try:
            import mpi4py  # noqa: F401
            variants += [(2, "from mpi4py import MPI", "assert MPI.COMM_WORLD.allreduce(1) == 2"),
                         (2, "", "from mpi4py import MPI\nassert MPI.COMM_WORLD.allreduce(1) == 2")]
        except ImportError:
            pass
        with tempfile.TemporaryDirectory() as folder:
            scene = Path(folder) / "scene.toml"
            scene.write_text(box().text)
            hashes = set()
            for n, first, last in variants:
                done = self.launch(n, RANKS_SCRIPT.format(first=first, last=last), scene, folder=folder)
                self.assertEqual(done.returncode, 0, done.stderr)
                size, text = done.stdout.split()
                self.assertEqual(int(size), n)
                hashes.add(text)
                self.assertEqual(moraine.Simulation.from_checkpoint(f"{scene}.h5").state_hash(), text)
            self.assertEqual(len(hashes), 1)

    def test_an_interrupt_of_one_rank_ends_all_after_the_same_whole_step(self):
        script = ("import os, signal, threading\nimport moraine\nrun = moraine.Simulation(moraine.Scene(" + repr(box().text) + "), threads=1)\n"
                  "if moraine.rank() == 1: threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()\n"
                  "try:\n    run.step(10**9)\nexcept KeyboardInterrupt:\n"
                  "    text = run.state_hash()\n    print(f'stopped {run.step_number} {text}\\n', end='')\nrun.step(10)\n")
        with tempfile.TemporaryDirectory() as folder:
            done = self.launch(2, script, folder=folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        (step, text), other = re.findall(r"stopped (\d+) (\w+)", done.stdout)
        self.assertEqual((step, text), other)
        alone = moraine.Simulation(box(), threads=1)
        alone.step(int(step))
        self.assertEqual(alone.state_hash(), text)

    def test_an_error_on_one_rank_ends_them_all(self):
        with tempfile.TemporaryDirectory() as folder:
            done = self.launch(2, "import moraine\nif moraine.rank() == 1: raise ValueError('only here')\n"
                                  "run = moraine.Simulation(moraine.Scene(" + repr(box().text) + "))\nrun.run()", folder=folder)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn("only here", done.stderr)


def parameters_of(function):
    """Their names; of what C++ defines, from the signature that pybind11 writes into its docstring."""
    try:
        return [name for name in inspect.signature(function).parameters]
    except ValueError:
        inside = re.match(r"\w+\((.*?)\) ->", function.__doc__).group(1)
        return re.findall(r"(?:^|, )\*{0,2}(\w+)(?=: )", inside)


class House(unittest.TestCase):
    def test_the_stubs_name_nothing_that_is_not_there_and_every_parameter_as_it_is(self):
        stub = ast.parse((Path(moraine.__file__).parent / "__init__.pyi").read_text())
        n_looked_at = 0
        for scope, nodes in [(moraine, stub.body)] + [(getattr(moraine, c.name, moraine._Edit), c.body) for c in stub.body if isinstance(c, ast.ClassDef)]:
            for node in nodes:
                if isinstance(node, ast.AnnAssign) and scope is moraine.Simulation:
                    self.assertTrue(hasattr(scope, node.target.id), node.target.id)
                if not isinstance(node, ast.FunctionDef) or scope is moraine._Edit:
                    continue
                wanted = [a.arg for a in node.args.args + node.args.kwonlyargs] + ([node.args.kwarg.arg] if node.args.kwarg else [])
                found = parameters_of(getattr(scope, node.name))
                if wanted[:1] == ["cls"]:
                    wanted = wanted[1:]
                self.assertEqual(found, wanted, f"{scope.__name__}.{node.name}")
                n_looked_at += 1
        self.assertGreater(n_looked_at, 20)

    def test_the_stubs_name_everything_that_is_there(self):
        stub = (Path(moraine.__file__).parent / "__init__.pyi").read_text()
        for name in dir(moraine.Simulation) + dir(moraine.Scene) + moraine.__all__:
            if not name.startswith("_"):
                self.assertRegex(stub, rf"\b{name}\b", f"{name} is not in __init__.pyi")

    def test_what_cmake_installs_is_whole(self):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(["cmake", "--install", PROGRAM.parent.parent, "--prefix", folder, "--component", "moraine"], check=True, stdout=subprocess.DEVNULL)
            module, = Path(folder).glob("lib/python3*/dist-packages")
            done = subprocess.run([sys.executable, "-c", "import moraine; print(moraine.__file__, moraine.__version__)"], capture_output=True, text=True,
                                  env=dict(ENVIRONMENT, PYTHONPATH=str(module)), cwd=folder)
            self.assertEqual(done.returncode, 0, done.stderr)
            place, version = done.stdout.split()
            self.assertEqual(Path(place).parent, module / "moraine")
            self.assertEqual(sorted(p.name for p in Path(place).parent.iterdir() if p.suffix == ".pyi"), ["__init__.pyi"])
            said = subprocess.run([Path(folder) / "bin" / "moraine", "--version"], capture_output=True, text=True, env=ENVIRONMENT).stdout
            self.assertIn(version, said)

    def test_the_tutorial_is_short_and_runs(self):
        tutorial = PROJECT / "examples" / "python" / "hopper_orifice.py"
        self.assertLess(len(tutorial.read_text().splitlines()), 60)
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([sys.executable, tutorial, "20", "26"], cwd=folder, capture_output=True, text=True, env=ENVIRONMENT)
            if "No module named 'matplotlib'" in done.stderr:
                self.skipTest("matplotlib is not installed")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((Path(folder) / "hopper_orifice.png").is_file())
            small, large = (float(line.split()[2]) for line in done.stdout.splitlines())
            self.assertGreater(large, 1.3 * small)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
