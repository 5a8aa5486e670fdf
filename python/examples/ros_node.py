"""A ROS 2 node that answers joint positions with the passive torque of a baked object. Needs a sourced ROS 2; not run by the tests.

    python ros_node.py --ros-args -p dataset:=sphere.haptize

Reads /joint_states, publishes efforts on /effort_controller/commands as ros2_control's JointGroupEffortController takes them. Positions that
are late or leap make the loop let go; it begins anew when the node is started again.
"""

import haptize
import rclpy
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray


class Touch(Node):
    def __init__(self):
        super().__init__("haptize")
        dataset = haptize.Dataset.load(self.declare_parameter("dataset", "sphere.haptize").value)
        self.names = [axis["name"] for axis in dataset.axes]
        self.loop = haptize.Loop(dataset)
        for warning in self.loop.warnings:
            self.get_logger().warning(warning)
        self.last = None
        self.commands = self.create_publisher(Float64MultiArray, "/effort_controller/commands", 1)
        self.create_subscription(JointState, "/joint_states", self.tick, 1)

    def tick(self, state):
        y = [state.position[state.name.index(name)] for name in self.names]
        now, measured = self.get_clock().now(), Time.from_msg(state.header.stamp)
        if self.last is None:
            self.loop.start(y)
        else:
            dt, age = (now - self.last).nanoseconds * 1e-9, (now - measured).nanoseconds * 1e-9
            self.commands.publish(Float64MultiArray(data=self.loop.tick(y, dt, max(age, 0.0)).tolist()))
        self.last = now
        if self.loop.fault:
            self.get_logger().error(self.loop.fault, once=True)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Touch())
