// A CHAI3D tool that feels a baked object: the joint torque of a haptize field becomes the tool's force. Needs CHAI3D 3; chai3d_press.cpp drives it
// without a device.
//
// The arm's joints must be those of the device: here the first three, and J, whose columns are the tip's velocity for a unit rate of each joint,
// comes from the device's kinematics. At the tip F = J^-T tau.
#pragma once

#include <chai3d.h>
#include <haptize.h>

#include <stdexcept>

class HaptizedTool {
public:
    explicit HaptizedTool(const char *dataset)
    {
        char message[512];
        if (hz_loop_open(dataset, nullptr, &loop_, message, sizeof message) != HZ_OK)
            throw std::runtime_error(message);
        if (hz_loop_joints(loop_) != 3) {
            hz_loop_close(loop_);
            throw std::runtime_error("the dataset is not one of three joints");
        }
    }
    ~HaptizedTool() { hz_loop_close(loop_); }
    HaptizedTool(const HaptizedTool &) = delete;
    HaptizedTool &operator=(const HaptizedTool &) = delete;

    // Call once in each turn of CHAI3D's haptic thread, `dt` seconds after the turn before, with the device's joint angles [rad] and J [m/rad].
    void update(chai3d::cGenericHapticDevicePtr device, const double (&angles)[3], const chai3d::cMatrix3d &jacobian, double dt)
    {
        double torque[3] = {0.0, 0.0, 0.0};
        if (!started_)
            started_ = hz_loop_start(loop_, angles) == HZ_OK;
        else
            hz_loop_tick(loop_, angles, 0.0, dt, torque, nullptr); // zero torque once it has let go
        chai3d::cMatrix3d inverse;
        jacobian.transr(inverse);
        chai3d::cVector3d force(0.0, 0.0, 0.0);
        if (inverse.invert()) // not where the arm is stretched: then no force
            force = inverse * chai3d::cVector3d(torque[0], torque[1], torque[2]);
        device->setForce(force.length() < 20.0 ? force : chai3d::cVector3d(0.0, 0.0, 0.0));
    }

private:
    hz_loop *loop_ = nullptr;
    bool started_ = false;
};
