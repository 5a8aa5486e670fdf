// The tool of chai3d_tool.hpp with a device that is only moved here: the tip of a Touch goes straight into the ball of datasets/touch.toml.
// Prints the forces that CHAI3D gave the device, and fails where they are not those of an object under the tip.
//
//     chai3d_press DATASET
#include "chai3d_tool.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>

namespace {

// Remembers the force that it is given [N].
class Remembering : public chai3d::cGenericHapticDevice {
public:
    Remembering() : cGenericHapticDevice(0) { m_deviceReady = true; }
    bool setForceAndTorqueAndGripperForce(const chai3d::cVector3d &force, const chai3d::cVector3d &torque, double gripper_force) override
    {
        m_prevForce = force;
        m_prevTorque = torque;
        m_prevGripperForce = gripper_force;
        return chai3d::C_SUCCESS;
    }
};

// d(tip)/dq of the Touch [m/rad]: waist, shoulder, elbow; upper arm 0.134 m, lower arm 0.1325 m.
chai3d::cMatrix3d jacobian(const double (&q)[3])
{
    const double upper = 0.134, lower = 0.1325, sum = q[1] + q[2];
    const double reach = upper * std::cos(q[1]) + lower * std::sin(sum);
    const double out[2] = {-upper * std::sin(q[1]) + lower * std::cos(sum), lower * std::cos(sum)};
    const double up[2] = {upper * std::cos(q[1]) + lower * std::sin(sum), lower * std::sin(sum)};
    const double s = std::sin(q[0]), c = std::cos(q[0]);
    return chai3d::cMatrix3d(-reach * c, -out[0] * s, -out[1] * s, -reach * s, out[0] * c, out[1] * c, 0.0, up[0], up[1]);
}

} // namespace

int main(int count, char **arguments)
{
    if (count != 2) {
        std::fprintf(stderr, "usage: chai3d_press DATASET\n");
        return EXIT_FAILURE;
    }
    try {
        HaptizedTool tool(arguments[1]);
        const std::shared_ptr<Remembering> device = std::make_shared<Remembering>();
        // The press of the scene: from 12 mm above the ball, 9 mm into it.
        const double above[3] = {0.0, 0.2055, -0.0247}, pressed[3] = {0.0, 0.0803, 0.0821};
        const int ticks = 1500;
        chai3d::cVector3d force(0.0, 0.0, 0.0);
        for (int tick = 0; tick <= ticks; tick++) {
            double q[3];
            for (int joint = 0; joint < 3; joint++)
                q[joint] = above[joint] + (pressed[joint] - above[joint]) * tick / ticks;
            tool.update(device, q, jacobian(q), 1e-3);
            device->getForce(force);
            if (tick % 300 == 0)
                std::printf("%4d ms: force (%6.3f, %6.3f, %6.3f) N\n", tick, force.x(), force.y(), force.z());
            // The proxy's damping is felt in free space, too.
            if (tick == 300 && force.length() > 0.1) {
                std::fprintf(stderr, "a force before the ball is touched\n");
                return EXIT_FAILURE;
            }
        }
        if (!(force.z() > 0.5 && force.z() > std::hypot(force.x(), force.y()))) {
            std::fprintf(stderr, "the ball does not push the tip up\n");
            return EXIT_FAILURE;
        }
        return EXIT_SUCCESS;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return EXIT_FAILURE;
    }
}
