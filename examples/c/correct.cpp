// The same in C++: handles that free themselves, and a thread for each robot.
//
// Usage: correct_cpp CALIB Q1 ... QN     readings in rad (m for prismatic joints)
#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "truearm.h"

namespace {

template <typename T, truearm_status (*free_handle)(T *)>
struct Freed {
    void operator()(T *handle) const { free_handle(handle); }
};
using Calibration = std::unique_ptr<truearm_calibration, Freed<truearm_calibration, truearm_calibration_free>>;
using Corrector = std::unique_ptr<truearm_corrector, Freed<truearm_corrector, truearm_corrector_free>>;
using Workspace = std::unique_ptr<truearm_workspace, Freed<truearm_workspace, truearm_workspace_free>>;

void check(truearm_status status, const char *message = "")
{
    if (status < TRUEARM_STATUS_OK) {
        throw std::runtime_error(std::string(truearm_status_text(status)) + " " + message);
    }
}

Calibration load(const char *path)
{
    std::array<char, 256> message{};
    truearm_calibration *calibration = nullptr;
    check(truearm_load_file(path, &calibration, message.data(), message.size()), message.data());
    return Calibration(calibration);
}

Corrector make_corrector(const Calibration &calibration)
{
    std::array<char, 256> message{};
    truearm_options options = truearm_default_options();
    options.largest_shift_m = 8e-3;
    truearm_corrector *corrector = nullptr;
    check(truearm_corrector_new(calibration.get(), nullptr, &options, &corrector, message.data(), message.size()),
          message.data());
    return Corrector(corrector);
}

// Threads share a corrector; each has a workspace of its own.
std::vector<double> corrected(const Corrector &corrector, std::vector<double> q)
{
    truearm_workspace *memory = nullptr;
    check(truearm_workspace_new(corrector.get(), &memory));
    const Workspace workspace(memory);
    truearm_correction correction{};
    const truearm_status status = truearm_correct(
        corrector.get(), workspace.get(), q.data(), q.size(), nullptr, 0, q.data(), q.size(), &correction);
    check(status);
    if (status == TRUEARM_STATUS_REFUSED) {
        throw std::runtime_error(truearm_reason_text(correction.reason));
    }
    return q;
}

} // namespace

int main(int count, char **words)
try {
    if (count < 2) {
        throw std::invalid_argument("usage: correct_cpp CALIB Q1 ... QN");
    }
    const Calibration calibration = load(words[1]);
    const Corrector corrector = make_corrector(calibration);
    std::vector<double> q;
    for (int k = 2; k < count; k++) {
        q.push_back(std::strtod(words[k], nullptr));
    }
    std::array<std::vector<double>, 2> found;
    std::thread other([&] { found[1] = corrected(corrector, q); });
    found[0] = corrected(corrector, q);
    other.join();
    std::printf("corrected");
    for (const double value : found[0]) {
        std::printf(" %.17g", value);
    }
    std::printf("\nthreads agree: %s\n", found[0] == found[1] ? "yes" : "no");
    return EXIT_SUCCESS;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return EXIT_FAILURE;
}
