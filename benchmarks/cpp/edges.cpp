// Line-R over a list of segments: edges PROBLEM SEGMENTS LENGTHS REPEATS
//
// SEGMENTS holds ax, ay, bx, by of each segment as 64-bit floats; LENGTHS is written, one for each.
// Prints {"wall": [...], "processor": [...]}: the seconds of each repetition.
#include "surface.hpp"

#include <chrono>
#include <cstdio>
#include <ctime>
#include <exception>

namespace {

void print(const char *name, const std::vector<double> &seconds) {
    std::printf("\"%s\": [", name);
    for (std::size_t k = 0; k < seconds.size(); ++k)
        std::printf("%s%.9g", k > 0 ? ", " : "", seconds[k]);
    std::printf("]");
}

template <class Surface>
void measure(const Surface &surface, const std::vector<double> &ends, std::vector<double> &lengths) {
    for (std::size_t m = 0; m < lengths.size(); ++m) {
        const double *end = ends.data() + 4 * m;
        lengths[m] = line_r(surface, end[0], end[1], end[2], end[3], 1);
    }
}

int run(char **argv) {
    const Problem problem(argv[1]);
    Numbers in(argv[2]);
    const std::vector<double> ends = in.many(in.size());
    std::vector<double> lengths(ends.size() / 4), wall, processor;
    for (int repeat = std::stoi(argv[4]); repeat > 0; --repeat) {
        const auto began = std::chrono::steady_clock::now();
        const std::clock_t used = std::clock();
        std::visit([&](const auto &surface) { measure(surface, ends, lengths); }, problem.surface);
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
        wall.push_back(took.count());
        processor.push_back(static_cast<double>(std::clock() - used) / CLOCKS_PER_SEC);
    }
    std::ofstream out(argv[3], std::ios::binary);
    out.write(reinterpret_cast<const char *>(lengths.data()),
              static_cast<std::streamsize>(lengths.size() * sizeof(double)));
    std::printf("{");
    print("wall", wall);
    std::printf(", ");
    print("processor", processor);
    std::printf("}\n");
    return out ? 0 : 1;
}

}  // namespace

int main(int argc, char **argv) {
    if (argc != 5) {
        std::fprintf(stderr, "usage: edges PROBLEM SEGMENTS LENGTHS REPEATS\n");
        return 2;
    }
    try {
        return run(argv);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "edges: %s\n", error.what());
        return 1;
    }
}
