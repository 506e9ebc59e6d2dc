"""Plants violations of every layer rule, one at a time, and asks the check for each; then plants what is allowed.

usage: check_layers_test.py PATH_OF_CHECK_LAYERS
"""

import os
import subprocess
import sys
import tempfile
import unittest

CHECK = sys.argv.pop(1)

# path, text, line of the violation, words that its message must have
FORBIDDEN = [
    # who may include whom
    ("kernels/contact/a.hpp", '#include "engine/scene/scene.hpp"\n', 1, "engine/scene/scene.hpp: kernels may include"),
    ("kernels/contact/a.hpp", '#include "comm/halo.hpp"\n', 1, "comm/halo.hpp: kernels may include"),
    ("kernels/contact/a.hpp", '#include "io/cli/main.hpp"\n', 1, "kernels may include"),
    ("kernels/base/a.hpp", '#include "kernels/contact/law.hpp"\n', 1, "kernels/base may include nothing but itself"),
    ("comm/a.hpp", '#include "kernels/contact/law.hpp"\n', 1, "comm may include"),
    ("comm/a.hpp", '#include "engine/particles/fields.hpp"\n', 1, "comm may include"),
    ("engine/scene/a.cpp", '\n\n#include "io/scene_toml/read.hpp"\n', 3, "engine may include"),
    ("engine/scene/a.cpp", '#  include "../../io/cli/main.hpp"\n', 1, "io/cli/main.hpp: engine may include"),
    ("engine/scene/a.cpp", "#include <io/cli/main.hpp>\n", 1, "engine may include"),
    ("engine/run/a.cpp", '#include "bench/kernels/b.hpp"\n', 1, "engine may include"),
    ("io/cli/a.cpp", '#include "tests/unit/b.hpp"\n', 1, "io may include"),
    # inside engine
    ("engine/scene/a.hpp", '#include "engine/walls/walls.hpp"\n', 1, "inside engine"),
    ("engine/particles/a.hpp", '#include "engine/contacts/pairs.hpp"\n', 1, "inside engine"),
    ("engine/contacts/a.hpp", '#include "engine/coupling/drag.hpp"\n', 1, "inside engine"),
    ("engine/coupling/a.hpp", '#include "engine/run/step.hpp"\n', 1, "inside engine"),
    ("engine/oddments/a.hpp", '#include "engine/scene/scene.hpp"\n', 1, "engine/oddments has no place"),
    ("engine/threads.hpp", '#include "engine/scene/scene.hpp"\n', 1, "below its folders"),
    # what may be used where
    ("io/cli/a.cpp", "#include <mpi.h>\n", 1, "MPI is used in comm only"),
    ("engine/run/a.cpp", "int f() {\n  return MPI_Barrier(MPI_COMM_WORLD);\n}\n", 2, "uses MPI_Barrier: MPI is used in comm"),
    ("engine/run/a.cpp", "void f() {\n#pragma omp parallel\n  {}\n}\n", 2, "OpenMP is used in engine/threads only"),
    ("engine/run/a.cpp", "void f() {\n  #  pragma   omp parallel\n  {}\n}\n", 2, "OpenMP"),
    ("engine/run/a.cpp", '_Pragma("omp simd")\n', 1, "OpenMP"),
    ("io/cli/a.cpp", "#include <omp.h>\n", 1, "OpenMP"),
    ("io/cli/a.cpp", "int n = omp_get_max_threads();\n", 1, "OpenMP"),
    ("engine/scene/a.cpp", "#include <toml++/toml.h>\n", 1, "TOML"),
    ("engine/run/a.cpp", "#include <hdf5.h>\n", 1, "HDF5"),
    ("engine/run/a.cpp", "#include <nlohmann/json.hpp>\n", 1, "JSON"),
    ("engine/run/a.cpp", "#include <pybind11/numpy.h>\n", 1, "Python"),
    ("engine/walls/a.cpp", "#include <assimp/Importer.hpp>\n", 1, "assimp"),
    ("engine/run/a.cpp", "#include <CLI/CLI.hpp>\n", 1, "command line"),
    ("kernels/contact/a.hpp", "#include <immintrin.h>\n", 1, "intrinsics"),
    ("kernels/base/vec3.hpp", "#include <hwy/highway.h>\n", 1, "intrinsics"),
    ("engine/contacts/a.cpp", "#include <hwy/foreach_target.h>\n", 1, "once for each instruction set in kernels only"),
    ("engine/contacts/a.cpp", "auto f(double* p) { return _mm256_loadu_pd(p); }\n", 1, "intrinsics"),
    ("kernels/contact/a.hpp", "struct A {\n  virtual void f();\n};\n", 2, "uses virtual: kernels have no virtual calls"),
    ("kernels/contact/a.cpp", "/* a\n b */ void f() { throw 1; }\n", 2, "uses throw: kernels have no exceptions"),
    ("kernels/contact/a.cpp", "int* f() { return new int(1); }\n", 1, "uses new: kernels do not allocate"),
    ("kernels/contact/a.cpp", "#include <vector>\n", 1, "kernels do not allocate"),
    ("kernels/contact/a.cpp", "#include <iostream>\n", 1, "kernels do no input or output"),
    ("kernels/contact/a.cpp", "#include <thread>\n", 1, "kernels know nothing of threads"),
    ("kernels/contact/a.cpp", "const int n = 1'000; char c = '\"'; int* p = new int; // \"\n", 1, "uses new"),
]

ALLOWED = {
    "kernels/base/simd_avx2.hpp": "#include <immintrin.h>\ninline auto f(double* p) { return _mm256_loadu_pd(p); }\n",
    "kernels/base/vec3.hpp": "// a new thing that may throw, virtual or not; #pragma omp\nstruct Vec3 { Vec3() = delete; };\n",
    "kernels/search/touch.hpp": '#include "kernels/base/vec3.hpp"\n',
    "kernels/contact/law.hpp": '#include "kernels/search/touch.hpp"\n/* #include <iostream>\n throw */\n'
                               'const char* text = "throw new virtual // MPI_Send(";\nint renewed, new_value;\n'
                               '_Pragma("GCC ivdep")\n',
    "kernels/contact/sweep/linear.cpp": "#include <hwy/foreach_target.h>\n",
    "comm/halo.hpp": '#include <mpi.h>\n#include "kernels/base/vec3.hpp"\ninline int f() { return MPI_SUCCESS; }\n',
    "io/files/mpi_handle.hpp": "#include <mpi.h>\n",
    "engine/threads.hpp": "#include <omp.h>\ninline void f() {\n#pragma omp parallel\n  {}\n}\n",
    "engine/scene/scene.hpp": '#include "kernels/base/vec3.hpp"\n',
    "engine/scene/validate.cpp": '#include "engine/particles/fill.hpp"\n',
    "engine/particles/fill.hpp": '#include "engine/scene/scene.hpp"\n#include "engine/threads.hpp"\n',
    "engine/walls/walls.hpp": '#include "engine/scene/scene.hpp"\n#include "kernels/search/touch.hpp"\n',
    "engine/contacts/forces.hpp": '#include "engine/walls/walls.hpp"\n#include "comm/halo.hpp"\n',
    "engine/coupling/drag.hpp": '#include "engine/contacts/forces.hpp"\n',
    "engine/run/run.hpp": '#include "engine/coupling/drag.hpp"\n#include <stdexcept>\n#include <vector>\n',
    "io/scene_toml/read.hpp": '#include <toml++/toml.h>\n#include "engine/run/run.hpp"\n',
    "io/cli/main.cpp": '#include "../scene_toml/read.hpp"\n#include <CLI/CLI.hpp>\n#include <hdf5.h>\n',
    "bench/kernels/sweep.cpp": '#include <omp.h>\n#include "io/scene_toml/read.hpp"\n',
    "tests/unit/walls.cpp": '#include <catch2/catch.hpp>\n#include <hdf5.h>\n#include "engine/walls/walls.hpp"\n',
}


def check(files):
    """Exit code and output of the check on a tree of these files."""
    with tempfile.TemporaryDirectory() as root:
        for path, text in files.items():
            full = os.path.join(root, path)
            os.makedirs(os.path.dirname(full), exist_ok=True)
            with open(full, "w", encoding="utf-8") as file:
                file.write(text)
        done = subprocess.run([sys.executable, CHECK, root], stdout=subprocess.PIPE, universal_newlines=True, check=False)
        return done.returncode, done.stdout


class CheckLayers(unittest.TestCase):
    def test_each_planted_violation_is_named_with_its_line(self):
        for path, text, line, words in FORBIDDEN:
            with self.subTest(path=path, text=text):
                code, output = check({path: text})
                self.assertEqual(code, 1, output)
                first = output.splitlines()[0]
                self.assertTrue(first.startswith("%s:%d: " % (path, line)), output)
                self.assertIn(words, first)

    def test_what_is_allowed_passes(self):
        code, output = check(ALLOWED)
        self.assertEqual((code, output), (0, "layers: %d files, no violation\n" % len(ALLOWED)))

    def test_one_violation_among_much_that_is_allowed_is_the_only_one_named(self):
        code, output = check(dict(ALLOWED, **{"engine/gas/solver.cpp": '#include "io/cli/main.hpp"\n'}))
        self.assertEqual(code, 1)
        self.assertEqual(len(output.splitlines()), 2, output)
        self.assertTrue(output.startswith("engine/gas/solver.cpp:1: includes io/cli/main.hpp"), output)

    def test_folders_that_include_each_other_in_a_circle_are_named(self):
        code, output = check({
            "engine/walls/a.hpp": '#include "engine/contacts/b.hpp"\n',
            "engine/contacts/b.hpp": '#include "engine/gas/c.hpp"\n',
            "engine/gas/c.hpp": '#include "engine/walls/a.hpp"\n',
        })
        self.assertEqual(code, 1)
        self.assertEqual(output.count("folders may not include each other in a circle"), 3, output)

    def test_a_tree_without_sources_is_not_taken_for_a_sound_one(self):
        self.assertEqual(check({"README.md": "nothing\n"})[0], 1)


if __name__ == "__main__":
    unittest.main()
