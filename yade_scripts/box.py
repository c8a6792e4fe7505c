"""Spheres in a closed box, run on from a given state with YADE's Hertz-Mindlin contacts.

    /usr/bin/python3 box.py --table fill_bed.csv --steps 350 --state yade_box.dump

Debian's own Python, as YADE's modules are built for that; OMP_NUM_THREADS says how many threads. Lengths in m, times in s. Springs
and dashpots are those of LIGGGHTS and tollgate but for two things: a contact never pulls, and the tangential force is summed up
step by step instead of being the present stiffness times the whole way. So kinetic energies do not compare.
"""

import argparse
import csv
import math
import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")  # read when yade is imported
sys.path.insert(1, "/usr/lib/x86_64-linux-gnu/yade-double/py")
from yade import *  # noqa: E402,F403
from yade import O, config, utils  # noqa: E402
from yade.minieigenHP import Vector3  # noqa: E402

YOUNG, POISSON, FRICTION, RESTITUTION = 5e6, 0.45, 0.5, 0.5
COLUMNS = "id density radius x y z vx vy vz omegax omegay omegaz"


def options():
    reader = argparse.ArgumentParser()
    reader.add_argument("--table", default="fill_bed.csv")
    reader.add_argument("--size", type=float, nargs=3, default=[0.1, 0.1, 0.28], help="of the box")
    reader.add_argument("--down", type=float, nargs=3, default=[0, 0, -1], help="direction of gravity, of any length")
    reader.add_argument("--step", type=float, default=1e-5)
    reader.add_argument("--steps", type=int, default=350)
    reader.add_argument("--skin", type=float, default=1e-4, help="how far boxes in the collider reach beyond their spheres")
    reader.add_argument("--state", default="yade_box.dump")
    return reader.parse_args()


def add_spheres(table, material):
    with open(table, newline="") as file:
        for row in csv.DictReader(file):
            number = {key: float(row[key]) for key in row if key != "material"}
            place = [number[key] for key in ("x_m", "y_m", "z_m")]
            body = utils.sphere(place, number["radius_m"], material=material, color=(1, 1, 1))
            body.state.vel = Vector3(*[number[key] for key in ("vx_m_per_s", "vy_m_per_s", "vz_m_per_s")])
            body.state.angVel = Vector3(*[number[key] for key in ("wx_rad_per_s", "wy_rad_per_s", "wz_rad_per_s")])
            O.bodies.append(body)


def add_walls(size, material):
    for axis in range(3):
        for place, sense in ((0.0, 1), (size[axis], -1)):
            O.bodies.append(utils.wall(place, axis, sense=sense, material=material))


def add_engines(arguments):
    logarithm = math.log(RESTITUTION)
    damping = math.sqrt(5 / 6) * -logarithm / math.hypot(logarithm, math.pi)  # of LIGGGHTS, in YADE's measure
    length = math.hypot(*arguments.down)
    O.engines = [
        ForceResetter(),
        InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()], verletDist=arguments.skin),
        InteractionLoop(
            [Ig2_Sphere_Sphere_ScGeom(avoidGranularRatcheting=False), Ig2_Wall_Sphere_ScGeom(hertzian=True)],
            [Ip2_FrictMat_FrictMat_MindlinPhys(betan=damping, betas=damping)],
            [Law2_ScGeom_MindlinPhys_Mindlin()],
        ),
        NewtonIntegrator(damping=0, gravity=[9.81 * part / length for part in arguments.down]),
    ]
    O.dt = arguments.step


def write_state(path):
    spheres = [body for body in O.bodies if isinstance(body.shape, Sphere)]
    with open(path, "w") as file:
        file.write("ITEM: TIMESTEP\n%d\nITEM: NUMBER OF ATOMS\n%d\n" % (O.iter, len(spheres)))
        file.write("ITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\nITEM: ATOMS %s\n" % COLUMNS)
        for body in spheres:
            state = body.state
            numbers = [body.material.density, body.shape.radius, *state.pos, *state.vel, *state.angVel]
            if not all(math.isfinite(number) for number in numbers):
                sys.exit("sphere %d has a number that is none" % body.id)
            file.write("%d %s\n" % (body.id + 1, " ".join(repr(float(number)) for number in numbers)))
    return len(spheres)


def main():
    arguments = options()
    material = O.materials.append(
        FrictMat(young=YOUNG, poisson=POISSON, frictionAngle=math.atan(FRICTION), density=2500)
    )
    add_spheres(arguments.table, material)
    add_walls(arguments.size, material)
    add_engines(arguments)
    O.run(arguments.steps, True)
    count = write_state(arguments.state)
    print("YADE %s did %d steps with %d spheres" % (config.version, O.iter, count), flush=True)


main()
