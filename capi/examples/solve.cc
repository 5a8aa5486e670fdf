// Solves a scene directly, beside the torque that a dataset of it holds.
//
//     solve SCENE DATASET Q1 [Q2 ...]
#include <haptize.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

struct Close {
    void operator()(hz_field *field) const { hz_field_close(field); }
    void operator()(hz_solver *solver) const { hz_solver_close(solver); }
};

template <typename Handle, typename Open>
std::unique_ptr<Handle, Close> open(Open open, const char *path)
{
    std::array<char, 1024> message{};
    Handle *handle = nullptr;
    if (open(path, &handle, message.data(), message.size()) != HZ_OK)
        throw std::runtime_error(message.data());
    return std::unique_ptr<Handle, Close>(handle);
}

void solve(const char *scene, const char *dataset, const std::vector<double> &q)
{
    const auto solver = open<hz_solver>(hz_solver_open, scene);
    const auto field = open<hz_field>(hz_field_open, dataset);
    if (hz_solver_joints(solver.get()) != q.size() || hz_field_joints(field.get()) != q.size())
        throw std::runtime_error("scene, dataset and configuration have different numbers of joints");

    hz_equilibrium equilibrium{};
    equilibrium.size = sizeof equilibrium;
    std::vector<hz_force> forces(1000);
    const hz_code code = hz_solver_solve(solver.get(), q.data(), &equilibrium, forces.data(), forces.size());
    forces.resize(equilibrium.forces);
    std::printf("solved %d %u %zu", static_cast<int>(code), static_cast<unsigned>(equilibrium.status), forces.size());
    for (std::size_t joint = 0; joint < q.size(); ++joint)
        std::printf(" %.17g", equilibrium.torque[joint]);

    // The same configuration three times over.
    std::vector<double> rows, torques(3 * q.size());
    for (int row = 0; row < 3; ++row)
        rows.insert(rows.end(), q.begin(), q.end());
    std::vector<std::uint8_t> status(3);
    const hz_code many = hz_field_torques(field.get(), 3, rows.data(), torques.data(), status.data());
    std::printf("\nlooked up %d %d", static_cast<int>(many), static_cast<int>(status[2]));
    for (std::size_t joint = 0; joint < q.size(); ++joint)
        std::printf(" %.17g", torques[2 * q.size() + joint]);
    std::printf("\n");
}

} // namespace

int main(int count, char **arguments)
{
    if (count < 4) {
        std::fprintf(stderr, "usage: solve SCENE DATASET Q1 [Q2 ...]\n");
        return EXIT_FAILURE;
    }
    std::vector<double> q;
    for (int k = 3; k < count; ++k)
        q.push_back(std::strtod(arguments[k], nullptr));
    try {
        solve(arguments[1], arguments[2], q);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return EXIT_FAILURE;
    }
    return EXIT_SUCCESS;
}
