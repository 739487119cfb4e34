// A surface over the plane and the length of a segment on it by Line-R: the same formulas as in
// terrapath's kernels, written as a C++ user would.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

struct Metric {
    double h11, h12, h22;

    double norm(double dx, double dy) const {
        return std::sqrt(h11 * dx * dx + 2.0 * h12 * dx * dy + h22 * dy * dy);
    }
};

struct Peak {
    double amplitude, falloff, x, y;
};

struct Layer {
    double weight;
    std::vector<Peak> peaks;
};

// Layers that are sums of Gaussian peaks.
struct Peaks {
    std::vector<Layer> layers;

    Metric metric(double x, double y) const {
        Metric h{1.0, 0.0, 1.0};
        for (const Layer &layer : layers) {
            double fx = 0.0, fy = 0.0;
            for (const Peak &peak : layer.peaks) {
                const double dx = x - peak.x, dy = y - peak.y;
                const double g =
                    peak.amplitude * peak.falloff * std::exp(-peak.falloff * (dx * dx + dy * dy));
                fx -= dx * g;
                fy -= dy * g;
            }
            const double w = 4.0 * layer.weight * layer.weight;
            h.h11 += w * fx * fx;
            h.h12 += w * fx * fy;
            h.h22 += w * fy * fy;
        }
        return h;
    }

    // The sum of the squared differences of the layers between two points.
    double squared_rise(double ax, double ay, double bx, double by) const {
        double total = 0.0;
        for (const Layer &layer : layers) {
            const double rise = layer.weight * (value(layer, bx, by) - value(layer, ax, ay));
            total += rise * rise;
        }
        return total;
    }

  private:
    static double value(const Layer &layer, double x, double y) {
        double total = 0.0;
        for (const Peak &peak : layer.peaks) {
            const double dx = x - peak.x, dy = y - peak.y;
            total += peak.amplitude * std::exp(-peak.falloff * (dx * dx + dy * dy));
        }
        return total;
    }
};

// The four uniform cubic B-splines that are not 0 at u in [0, 1], and their slopes.
struct Basis {
    double value[4], slope[4];

    explicit Basis(double u) {
        const double r = 1.0 - u;
        value[0] = r * r * r / 6.0;
        value[1] = (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0;
        value[2] = (4.0 - 6.0 * r * r + 3.0 * r * r * r) / 6.0;
        value[3] = u * u * u / 6.0;
        slope[0] = -0.5 * r * r;
        slope[1] = u * (1.5 * u - 2.0);
        slope[2] = r * (2.0 - 1.5 * r);
        slope[3] = 0.5 * u * u;
    }
};

// Layers that are uniform bicubic B-splines.
struct Spline {
    std::size_t rows, columns;
    double x0, y0, dx, dy;
    std::vector<double> weights;
    std::vector<double> coefficients;  // layer by layer, row by row

    Metric metric(double x, double y) const {
        const Place place = locate(x, y);
        const Basis bx(place.u), by(place.v);
        Metric h{1.0, 0.0, 1.0};
        for (std::size_t layer = 0; layer < weights.size(); ++layer) {
            const double *corner = corner_of(layer, place);
            const double fx = weights[layer] * sum(corner, bx.slope, by.value) / dx;
            const double fy = weights[layer] * sum(corner, bx.value, by.slope) / dy;
            h.h11 += fx * fx;
            h.h12 += fx * fy;
            h.h22 += fy * fy;
        }
        return h;
    }

    double squared_rise(double ax, double ay, double bx, double by) const {
        double total = 0.0;
        for (std::size_t layer = 0; layer < weights.size(); ++layer) {
            const double rise = weights[layer] * (value(layer, bx, by) - value(layer, ax, ay));
            total += rise * rise;
        }
        return total;
    }

  private:
    struct Place {
        std::size_t i, j;
        double u, v;
    };

    Place locate(double x, double y) const {
        const double s = (x - x0) / dx, t = (y - y0) / dy;
        const double i = std::clamp(std::floor(s), 0.0, static_cast<double>(columns) - 4.0);
        const double j = std::clamp(std::floor(t), 0.0, static_cast<double>(rows) - 4.0);
        return {static_cast<std::size_t>(i), static_cast<std::size_t>(j), s - i, t - j};
    }

    const double *corner_of(std::size_t layer, const Place &place) const {
        return coefficients.data() + (layer * rows + place.j) * columns + place.i;
    }

    double sum(const double *corner, const double *bx, const double *by) const {
        double total = 0.0;
        for (int j = 0; j < 4; ++j, corner += columns)
            total += by[j] * (bx[0] * corner[0] + bx[1] * corner[1] + bx[2] * corner[2] +
                              bx[3] * corner[3]);
        return total;
    }

    double value(std::size_t layer, double x, double y) const {
        const Place place = locate(x, y);
        return sum(corner_of(layer, place), Basis(place.u).value, Basis(place.v).value);
    }
};

// Line-R: the 5-point Boole rule on each of a number of equal panels.
template <class Surface>
double line_r(const Surface &surface, double ax, double ay, double bx, double by, int panels) {
    static const double weights[4] = {7.0 / 45.0, 16.0 / 45.0, 2.0 / 15.0, 16.0 / 45.0};
    const double dx = bx - ax, dy = by - ay;
    double total =
        7.0 / 90.0 * (surface.metric(ax, ay).norm(dx, dy) + surface.metric(bx, by).norm(dx, dy));
    const int intervals = 4 * panels;
    for (int k = 1; k < intervals; ++k) {
        const double t = static_cast<double>(k) / intervals;
        const Metric h = surface.metric(t * bx + (1.0 - t) * ax, t * by + (1.0 - t) * ay);
        total += weights[k % 4] * h.norm(dx, dy);
    }
    return total / panels;
}

// An edge as terrapath's trees measure it: Line-R in panels, never shorter than the chord in R^n.
template <class Surface>
double edge_length(const Surface &surface, double panel, double ax, double ay, double bx,
                   double by) {
    const double dx = bx - ax, dy = by - ay, flat = dx * dx + dy * dy;
    const int panels = std::max(static_cast<int>(std::ceil(std::sqrt(flat) / panel)), 1);
    const double chord = std::sqrt(flat + surface.squared_rise(ax, ay, bx, by));
    return std::max(line_r(surface, ax, ay, bx, by, panels), chord);
}

struct Disc {
    double x, y, radius;

    bool meets(double ax, double ay, double bx, double by) const {
        const double dx = bx - ax, dy = by - ay, length = dx * dx + dy * dy;
        const double along = (x - ax) * dx + (y - ay) * dy;
        const double t = length > 0.0 ? std::clamp(along / length, 0.0, 1.0) : 0.0;
        return std::hypot(ax + t * dx - x, ay + t * dy - y) <= radius;
    }
};

// A file of 64-bit floats, read one after another.
class Numbers {
  public:
    explicit Numbers(const std::string &path) {
        std::ifstream file(path, std::ios::binary | std::ios::ate);
        if (!file) throw std::runtime_error("cannot read " + path);
        numbers_.resize(static_cast<std::size_t>(file.tellg()) / sizeof(double));
        file.seekg(0);
        file.read(reinterpret_cast<char *>(numbers_.data()),
                  static_cast<std::streamsize>(numbers_.size() * sizeof(double)));
    }

    std::size_t size() const { return numbers_.size(); }
    double next() { return numbers_.at(place_++); }
    std::size_t count() { return static_cast<std::size_t>(next()); }
    std::vector<double> many(std::size_t count) {
        std::vector<double> found(count);
        for (double &number : found) number = next();
        return found;
    }

  private:
    std::vector<double> numbers_;
    std::size_t place_ = 0;
};

struct Problem {
    double low[2], high[2], start[2], goal[2];
    double panel;
    std::variant<Peaks, Spline> surface;
    std::vector<Disc> discs;

    explicit Problem(const std::string &path) {
        Numbers in(path);
        for (double *pair : {low, high, start, goal})
            for (int k = 0; k < 2; ++k) pair[k] = in.next();
        panel = in.next();
        const bool is_spline = in.next() != 0.0;
        const std::vector<double> weights = in.many(in.count());
        if (is_spline)
            surface = read_spline(in, weights);
        else
            surface = read_peaks(in, weights);
        discs.resize(in.count());
        for (Disc &disc : discs) {
            disc.x = in.next();
            disc.y = in.next();
            disc.radius = in.next();
        }
    }

    bool is_free(double ax, double ay, double bx, double by) const {
        for (const Disc &disc : discs)
            if (disc.meets(ax, ay, bx, by)) return false;
        return true;
    }

  private:
    static Peaks read_peaks(Numbers &in, const std::vector<double> &weights) {
        Peaks peaks;
        for (double weight : weights) {
            Layer layer{weight, std::vector<Peak>(in.count())};
            for (Peak &peak : layer.peaks) {
                const std::vector<double> found = in.many(4);
                peak = {found[0], found[1], found[2], found[3]};
            }
            peaks.layers.push_back(layer);
        }
        return peaks;
    }

    static Spline read_spline(Numbers &in, const std::vector<double> &weights) {
        Spline spline;
        spline.rows = in.count();
        spline.columns = in.count();
        for (double *number : {&spline.x0, &spline.y0, &spline.dx, &spline.dy}) *number = in.next();
        spline.weights = weights;
        spline.coefficients = in.many(weights.size() * spline.rows * spline.columns);
        return spline;
    }
};
