// Many threads ask one database at once, from C++: answers are those of one thread.
// Usage: threads FILE
#define SPLITSNOW_IMPLEMENTATION
#include "splitsnow.h"

#include <cstdio>
#include <thread>
#include <vector>

static std::vector<float> answers(const splitsnow *database, const splitsnow_lookup *lookup,
                                  const splitsnow_colour *colour) {
    size_t n = 0;
    splitsnow_wavelengths(database, &n);
    std::vector<float> all, spectrum(n);
    for (int i = 0; i < 500; i++) {
        double rgb[3], thickness_cm = 0.1 * i, angle_deg = i % 50;
        if (splitsnow_spectrum(lookup, thickness_cm, angle_deg, spectrum.data(), n) != SPLITSNOW_OK ||
            splitsnow_linear_srgb(lookup, colour, thickness_cm, angle_deg, rgb) != SPLITSNOW_OK) {
            return {};
        }
        all.insert(all.end(), spectrum.begin(), spectrum.end());
        all.push_back(static_cast<float>(rgb[2]));
    }
    return all;
}

int main(int argc, char **argv) {
    char message[256] = "a file must be given";
    splitsnow *database = nullptr;
    if (argc != 2 || splitsnow_open(argv[1], &database, message, sizeof message) != SPLITSNOW_OK) {
        std::fprintf(stderr, "%s\n", message);
        return 1;
    }
    const splitsnow_snow snow = {0.3, 200.0, 300.0};
    splitsnow_lookup *lookup = nullptr;
    splitsnow_colour *colour = nullptr;
    splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, &snow, nullptr, 0, &lookup);
    splitsnow_colour_new(database, SPLITSNOW_D65, nullptr, 0, &colour);
    const std::vector<float> expected = answers(database, lookup, colour);
    std::vector<std::vector<float>> found(4);
    std::vector<std::thread> threads;
    for (auto &one : found) {
        threads.emplace_back([&] {
            splitsnow_lookup *own = nullptr; // preparing is for all threads, too
            splitsnow_prepare(database, SPLITSNOW_TRANSMITTANCE, &snow, nullptr, 0, &own);
            one = answers(database, lookup, colour);
            if (answers(database, own, colour) != one) one.clear();
            splitsnow_lookup_free(own);
        });
    }
    bool same = !expected.empty();
    for (auto &thread : threads) thread.join();
    for (const auto &one : found) same = same && one == expected;
    splitsnow_colour_free(colour);
    splitsnow_lookup_free(lookup);
    splitsnow_close(database);
    return same ? 0 : 1;
}
