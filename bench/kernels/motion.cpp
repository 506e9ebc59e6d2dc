// Summing the forces of each grain and advancing it.
#include "bench/kernels/bed.hpp"

namespace moraine::bench {

void add_motion() {
  for (const Size size : sizes)
    for (const bool has_rotation : {true, false})
      for (const bool has_ledger : {false, true})
        add(std::string("motion/") + (has_rotation ? "spin" : "still") + (has_ledger ? "/ledger/" : "/") +
                name_of(size),
            [=](benchmark::State& state) {
              Bed& b = bed(size, has_rotation);
              const LawChoice choice{NormalLaw::linear, TangentialLaw::spring, has_rotation, true, has_ledger};
              b.restart(choice);
              b.run(contact_kernels(choice).pairs, b.sweep(choice, false), slot_bytes(choice));
              const GrainSums sums = b.sums(choice);
              const MotionKernel kernel = motion_kernel(has_rotation, has_ledger);
              measure(state, work_of_motion(b, choice), [&] {
                benchmark::DoNotOptimize(kernel(sums, nullptr, {0, b.particles.size()}));
              });
            });
}

}  // namespace moraine::bench
