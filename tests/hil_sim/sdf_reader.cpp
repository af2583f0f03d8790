// SPDX-License-Identifier: MIT
// Reads a robot as Gazebo does, by the SDF project's own library, and prints what it understood.
// It prints one line per link and per joint, all in the frame of the chassis.
//
//     sdf_reader FILE
#include <cstdio>

#include <sdf/sdf.hh>

namespace {

constexpr const char *chassis = "base_link";

int fail(const sdf::Errors &errors) {
    for (const sdf::Error &error : errors) {
        std::fprintf(stderr, "%s\n", error.Message().c_str());
    }
    return errors.empty() ? 0 : 1;
}

int print_link(const sdf::Link &link) {
    const ignition::math::Inertiald &inertia = link.Inertial();
    std::printf("link %s %.12g %d\n", link.Name().c_str(), inertia.MassMatrix().Mass(),
                inertia.MassMatrix().IsValid() ? 1 : 0);
    return 0;
}

int print_joint(const sdf::Joint &joint) {
    ignition::math::Pose3d pose;
    ignition::math::Vector3d axis;
    int failed = fail(joint.SemanticPose().Resolve(pose, chassis));
    failed |= fail(joint.Axis(0)->ResolveXyz(axis, chassis));
    std::printf("joint %s %d %.12g %.12g %.12g %.12g %.12g %.12g\n", joint.Name().c_str(),
                static_cast<int>(joint.Type()), pose.X(), pose.Y(), pose.Z(), axis.X(), axis.Y(), axis.Z());
    return failed;
}

} // namespace

int main(int count, char **words) {
    sdf::Root root;
    if (count != 2 || fail(root.Load(words[1])) != 0 || root.Model() == nullptr) {
        std::fprintf(stderr, "usage: sdf_reader FILE with one model\n");
        return 1;
    }
    const sdf::Model &model = *root.Model();
    int failed = 0;
    for (uint64_t i = 0; i < model.LinkCount(); ++i) {
        failed |= print_link(*model.LinkByIndex(i));
    }
    for (uint64_t i = 0; i < model.JointCount(); ++i) {
        failed |= print_joint(*model.JointByIndex(i));
    }
    return failed;
}
