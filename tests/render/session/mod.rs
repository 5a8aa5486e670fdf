//! The haptic and the graphics loop, driven from outside: energy accounts, limits, faults, repeatability.

mod accounts;
mod live;
mod memory;
mod object;
mod press;
mod range;
mod recording;
mod safety;
mod twinned;

use crate::common::desktop::{haptics, proxy};
use glam::DVec3;
use haptize::{
    JointVector,
    contact::{Model, Proximity, Status},
    dataset::{Contacts, Dataset, JointLabel},
    device::{Applied, Clamps, Device, Halt, Motion, Reading, Recorded, SimulatedHand},
    field::{Sample, TorqueField, range::HaptizedRange},
    fixtures::grids::{grid, half_space},
    object::Object,
    proxy::Chain,
    render::{
        accounts::Accounts,
        flags::{Fault, Flags},
        graphics::{ContactForces, Graphics, ObjectMotion},
        haptic::{Haptics, Inputs},
        npmi::Npmi,
        passivity,
        recording::Recording,
        session::{self, Driver, Plan},
        setup::{Setup, labels},
        trace::{Frame, Tick, Trace},
    },
    scene::{
        GraphicsEffects, GraphicsSpec, GroundNodes, GroundSpec, GroundStiffness, HapticsSpec, Interpolation, Material,
        ObjectSpec, Scene, Shape, SpringKind, SpringSpec, Waypoint,
    },
    sweep::baked,
};

fn vector(values: &[f64]) -> JointVector {
    JointVector::from_slice(values)
}

fn all(joints: usize, value: f64) -> JointVector {
    vector(&vec![value; joints])
}

/// A half space of 5 N m/rad in `joints` joints, on a grid from -0.6 to 0.6 rad.
fn half_space_of(joints: usize) -> Dataset {
    let count = if joints > 3 { 5 } else { 13 };
    half_space(grid(&vec![(-0.6, 1.2 / (count - 1) as f64, count); joints]), 5.0)
}

fn build(data: &Dataset, spec: &HapticsSpec) -> Haptics {
    let field = TorqueField::interpolated(data, Interpolation::Linear, spec.threshold, &spec.boundary_slope).unwrap();
    Haptics::new(field, proxy(data.grid.joints()), spec).unwrap()
}

fn plan(data: &Dataset, seconds: f64) -> Plan {
    Plan::new(labels(&data.grid), 1e-3, seconds, 0)
}

/// Into the object, along it, and out again, in two seconds.
fn press(joints: usize) -> Motion {
    let mut along = all(joints, 0.25);
    along[0] = 0.35;
    let way = [(0.0, all(joints, -0.2)), (0.7, all(joints, 0.25)), (1.3, along), (2.0, all(joints, -0.2))];
    Motion::through(&way.map(|(time, q)| Waypoint { time, q }), joints).unwrap()
}

fn pressed(joints: usize, spec: &HapticsSpec) -> Trace {
    let data = half_space_of(joints);
    let haptics = build(&data, spec);
    let mut hand = SimulatedHand::new(spec, press(joints)).unwrap();
    session::run(&haptics, &mut hand, None, &plan(&data, 2.0)).unwrap()
}

/// A device that reports what it is told, and keeps the torque that it was given last.
struct Scripted {
    readings: Vec<Reading>,
    next: usize,
    torque: JointVector,
}

impl Scripted {
    fn new(positions: impl IntoIterator<Item = JointVector>) -> Self {
        let reading = Reading::at;
        Self { readings: positions.into_iter().map(reading).collect(), next: 0, torque: vector(&[]) }
    }
}

impl Device for Scripted {
    fn read(&mut self, _: f64) -> Reading {
        let reading = self.readings[self.next.min(self.readings.len() - 1)];
        self.next += 1;
        reading
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        self.torque = *torque;
        Applied::whole(torque)
    }
}
