"""The README does not promise what is not there: its scene passes `moraine check`, and each command that it lists exists.

usage: readme_test.py ROOT PROGRAM
"""

import os
import re
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop()
ROOT = sys.argv.pop()
with open(os.path.join(ROOT, "README.md"), encoding="utf-8") as file:
    README = file.read()


def run(*arguments):
    done = subprocess.run(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, check=False)
    return done.returncode, done.stdout


class Readme(unittest.TestCase):
    def test_its_scene_can_be_run(self):
        self.check_scene_of(README)

    def test_the_scene_for_those_who_come_from_other_codes_can_be_run(self):
        with open(os.path.join(ROOT, "examples", "coming_from.md"), encoding="utf-8") as page:
            self.check_scene_of(page.read())

    def test_the_page_for_those_who_come_from_other_codes_shows_the_files_that_were_run(self):
        with open(os.path.join(ROOT, "examples", "coming_from.md"), encoding="utf-8") as page:
            shown = re.findall(r"```\w*\n(.*?)```", page.read(), re.DOTALL)
        self.assertEqual(len(shown), 5)
        for name, text in zip(("scene.toml", "liggghts_box.in", "mfix_box.mfx", "yade_box.py", "esys_box.py"), shown):
            with open(os.path.join(ROOT, "examples", "coming_from", name), encoding="utf-8") as file:
                self.assertEqual(file.read(), text, name)

    def test_the_scene_for_those_who_come_from_other_codes_settles_as_the_page_says(self):
        with open(os.path.join(ROOT, "examples", "coming_from.md"), encoding="utf-8") as page:
            height = float(re.search(r"^\| Moraine \|(?: [\d.]+ \|){3} ([\d.]+) \|", page.read(), re.MULTILINE).group(1))
        with tempfile.TemporaryDirectory() as folder:
            out = os.path.join(folder, "run")
            code, output = run(PROGRAM, "run", os.path.join(ROOT, "examples", "coming_from", "scene.toml"), "--out", out, "--set", "time.end=0.2")
            self.assertEqual(code, 0, output)
            self.assertIn("1865 born, 1865 inside, 0 left", output)
            code, output = run(PROGRAM, "export", out, "--csv")
            self.assertEqual(code, 0, output)
            last = max(name for name in os.listdir(os.path.join(out, "csv")) if name.startswith("grains_"))
            with open(os.path.join(out, "csv", last), encoding="utf-8") as table:
                names, *rows = [line.rstrip("\n").split(",") for line in table]
        heights = [float(row[names.index("position.z [m]")]) for row in rows]
        self.assertAlmostEqual(1000 * sum(heights) / len(heights), height, delta=0.05)

    def check_scene_of(self, page):
        scenes = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
        self.assertEqual(len(scenes), 1)
        with tempfile.TemporaryDirectory() as folder:
            scene = os.path.join(folder, "scene.toml")
            with open(scene, "w", encoding="utf-8") as file:
                file.write(scenes[0])
            code, output = run(PROGRAM, "check", scene)
        self.assertEqual(code, 0, output)

    def test_the_page_of_scene_keys_is_what_the_program_has(self):
        code, output = run(PROGRAM, "keys")
        self.assertEqual(code, 0)
        with open(os.path.join(ROOT, "examples", "keys.md"), encoding="utf-8") as page:
            self.assertEqual(page.read(), output, "renew it: ./moraine keys > examples/keys.md")

    def test_each_example_links_to_what_is_there_and_is_listed(self):
        with open(os.path.join(ROOT, "examples", "README.md"), encoding="utf-8") as page:
            listed = page.read()
        for name in sorted(os.listdir(os.path.join(ROOT, "examples"))):
            folder = os.path.join(ROOT, "examples", name)
            if not os.path.isfile(os.path.join(folder, "README.md")):
                continue
            self.assertIn(f"({name})", listed)
            with open(os.path.join(folder, "README.md"), encoding="utf-8") as page:
                for link in re.findall(r"\]\((?!https?:)([^)#]+)[^)]*\)", page.read()):
                    self.assertTrue(os.path.exists(os.path.join(folder, link)), f"{name}: {link}")

    def test_each_command_that_it_lists_exists(self):
        commands = re.findall(r"^\| `\./moraine (\w+)", README, re.MULTILINE)
        self.assertGreater(len(commands), 5)
        for command in commands:
            if command in ("build", "test", "bench", "python"):  # the launcher's own
                continue
            with self.subTest(command=command):
                code, output = run(PROGRAM, command, "--help")
                self.assertEqual(code, 0, output)
                self.assertIn(command, output)

    def test_each_option_of_run_that_it_shows_exists(self):
        output = run(PROGRAM, "run", "--help")[1]
        for option in set(re.findall(r"(?<![\w-])--(?:layout|out|set|restart|until)\b", README)):
            with self.subTest(option=option):
                self.assertIn(option, output)

    def test_each_file_and_folder_that_it_links_to_exists(self):
        for link in re.findall(r"\]\((?!https?:)([^)#]+)\)|<img src=\"([^\"]+)\"", README):
            with self.subTest(link=link):
                self.assertTrue(os.path.exists(os.path.join(ROOT, link[0] or link[1])))


if __name__ == "__main__":
    unittest.main()
