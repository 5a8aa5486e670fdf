"""An arm in MuJoCo feels a baked object: the field's torque enters through qfrc_applied. Beside it the same arm presses MuJoCo's own flex.

    haptize bake datasets/sphere.toml
    python python/examples/mujoco_arm.py sphere.haptize figure.png        # pip install mujoco matplotlib

The flex is a solid ball and haptize's sphere a skin on a foundation: its Young's modulus is chosen for about the same greatest torque, so that
the figure compares the course of the torque and the time that a step takes, not two solutions of one problem.
"""

import sys
import time

import haptize
import mujoco
import numpy as np

JOINTS = ("yaw", "shoulder", "elbow")

# The arm of datasets/sphere.toml.
MODEL = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0" integrator="discrete"/>
  <worldbody>
    <body pos="-0.03 0 0.176">
      <joint name="yaw" axis="0 0 1" armature="0.001" damping="0.02"/>
      <inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
      <body>
        <joint name="shoulder" axis="0 1 0" armature="0.001" damping="0.02"/>
        <geom type="capsule" fromto="0.00875 0 0 0.14 0 0" size="0.0005" mass="0.05" condim="1"/>
        <body pos="0.14 0 0">
          <joint name="elbow" axis="0 1 0" armature="0.001" damping="0.02"/>
          <geom type="capsule" fromto="0.00875 0 0 0.14 0 0" size="0.0005" mass="0.05" condim="1"/>
        </body>
      </body>
    </body>
    {object}
  </worldbody>
</mujoco>
"""

YOUNG = 8e4  # Pa

# A ball of 9 nodes across and the radius of the sphere, that of its facets included, held at its centre and at its lower end as a ball on a table is.
FLEX = """
<body name="support">
  <flexcomp name="ball" type="ellipsoid" count="9 9 9" spacing="0.0114 0.0114 0.0114" mass="0.5" dim="3" radius="0.004">
    <elasticity young="{young}" poisson="0.3" damping="0.01"/>
    <contact selfcollide="none" condim="1" solref="0.004 1" solimp="0.95 0.99 0.001"/>
    <pin id="{pinned}"/>
  </flexcomp>
</body>
"""


def flex_model() -> mujoco.MjModel:
    """The arm beside a flex ball."""
    free = mujoco.MjModel.from_xml_string(MODEL.format(object=FLEX.format(young=YOUNG, pinned="0")))
    data = mujoco.MjData(free)
    mujoco.mj_forward(free, data)
    nodes = data.flexvert_xpos
    pinned = np.flatnonzero((np.linalg.norm(nodes, axis=1) < 0.02) | (nodes[:, 2] < -0.035))
    return mujoco.MjModel.from_xml_string(MODEL.format(object=FLEX.format(young=YOUNG, pinned=" ".join(map(str, pinned)))))


def press(model: mujoco.MjModel, field: haptize.Field | None) -> tuple[np.ndarray, np.ndarray, float]:
    """Follow the scene's press under PD control, against `field` or what is in the model.

    Returns times [s], contact torque at the joints [N m], and milliseconds of a processor a step, which other programs do not lengthen.
    """
    data = mujoco.MjData(model)
    dof = [model.joint(name).dofadr[0] for name in JOINTS]
    place = [model.joint(name).qposadr[0] for name in JOINTS]
    when = [0.0, 0.2, 1.2, 1.6, 2.6]
    way = np.array([[0.1, 1.65, -2.28]] * 2 + [[0.1, 1.65, -1.85]] * 2 + [[0.1, 1.65, -2.28]])
    data.qpos[place] = way[0]
    times, torques, begin = [], [], time.process_time()
    while data.time < when[-1]:
        goal = np.array([np.interp(data.time, when, way[:, joint]) for joint in range(3)])
        control = 60.0 * (goal - data.qpos[place]) - 1.0 * data.qvel[dof]
        felt = np.zeros(3) if field is None else field.torque(data.qpos[place])
        data.qfrc_applied[dof] = control + felt
        mujoco.mj_step(model, data)
        times.append(data.time)
        torques.append(data.qfrc_constraint[dof].copy() if field is None else felt)
    return np.array(times), np.array(torques), 1e3 * (time.process_time() - begin) / len(times)


def main() -> None:
    dataset, figure = sys.argv[1:]
    field = haptize.Field.open(dataset)
    baked = press(mujoco.MjModel.from_xml_string(MODEL.format(object="")), field)
    flex = press(flex_model(), None)
    for name, (_, torque, step) in (("haptize field", baked), ("MuJoCo flex", flex)):
        print(f"{name:14} {step:6.3f} ms a step, greatest torque {np.abs(torque).max():.3f} N m")

    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    canvas, panels = pyplot.subplots(3, 1, sharex=True, figsize=(7, 7), layout="constrained")
    for joint, panel in enumerate(panels):
        panel.plot(baked[0], baked[1][:, joint], label=f"haptize field, {baked[2]:.2f} ms a step")
        panel.plot(flex[0], flex[1][:, joint], label=f"MuJoCo flex, {flex[2]:.2f} ms a step")
        panel.set_ylabel(f"{JOINTS[joint]} [N m]")
    panels[0].legend()
    panels[0].set_title("Contact torque of an arm that presses a soft ball")
    panels[-1].set_xlabel("time [s]")
    canvas.savefig(figure, dpi=120)


if __name__ == "__main__":
    main()
