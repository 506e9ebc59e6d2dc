"""The shipped examples, made small by settings, for tests that run all of them."""

# name: settings that make it small, time of the stop and the restart [s], whether grains must leave
SMALL = {
    "hopper": (["time.end=0.9", "wall[5].until=0.05", "output.snapshots=0.3"], 0.5, True),
    "silo": (["time.end=0.12", "wall[2].until=0.02", "output.snapshots=0.04",
              "particles[0].fill.region.cylinder.length=0.03"], 0.06, True),
    "jet_bed": (["time.end=0.15", "output.snapshots=0.05"], 0.08, False),
    "fluidized_bed": (["time.end=0.05", "output.snapshots=0.01"], 0.02, False),
    "deep_bed": (["time.end=0.04", "output.snapshots=0.01", "domain.high=[0.08,0.08,0.25]", "gas.cells=[8,8,25]",
                  "particles[0].fill.count=5000", "probe[2].region={}"], 0.02, False),
    "tall_bed": (["time.end=0.05", "domain.high=[0.03,0.03,0.5]", "particles[0].fill.region.box.high=[0.03,0.03,0.12]",
                  "particles[1].fill.region.box.low=[0,0,0.14]", "particles[1].fill.region.box.high=[0.03,0.03,0.45]",
                  "particles[1].fill.count=60", "wall[1].plane.point=[0,0,0.5]", "output.snapshots=0.01"], 0.02, False),
    "rotating_drum": (["time.end=0.08", "output.snapshots=0.02", "wall[0].motion[0].ramp=[[0.0, 0.0], [0.02, 1.0]]",
                       "probe[2].average=0.03"], 0.04, False),
    "silo_refill": (["time.end=0.2", "output.snapshots=0.05", "wall[2].until=0.02"], 0.12, True),
    "mixer": (["time.end=0.06", "output.snapshots=0.02", "wall[2].motion[0].ramp=[[0.0, 1.0]]",
               "wall[3].motion[0].ramp=[[0.0, 1.0]]"], 0.03, False),
    "spouted_bed_recycle": (["time.end=0.3", "output.snapshots=0.1", "outlet[0].box.low=[0.0, 0.15, 0.0]"], 0.16, True),
    "wet_pile": (["time.end=0.15", "wall[1].until=0.03", "output.snapshots=0.05"], 0.08, True),
    "settled_bed": (["time.end=0.08", "domain.high=[0.04, 0.12, 0.05]", "output.snapshots=0.02"], 0.05, False),
}
