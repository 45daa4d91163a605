// Reads the .csv files that `law.table(...).save("law.csv")` of asperity writes, and draws what they tabulate.
// C++11 or later, no dependencies. Angles are radians. Errors are std::runtime_error: what was expected, what came.
//
//     asperity::Table law("law.csv");
//     double v[3] = {300.0, 0.0, -400.0};  // the third component is along the outward normal of the wall
//     law.reflect(v, 0.0, u, w);           // u and w: independent random numbers, uniform in [0, 1)
#ifndef ASPERITY_TABLE_HPP
#define ASPERITY_TABLE_HPP
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace asperity {
class Table {
public:
    explicit Table(const std::string& path) : path_(path) {
        std::ifstream file(path);
        if (!file) fail("a file that can be read", "none");
        const std::string angles = "# asperity table 1:", directions = "# asperity table of directions 1:";
        std::string line;
        std::getline(file, line);
        of_directions_ = line.compare(0, directions.size(), directions) == 0;
        if (!of_directions_ && line.compare(0, angles.size(), angles) != 0)
            fail("a first line that begins with '" + angles + "' or '" + directions + "'", line.substr(0, 60));
        for (std::size_t number = 2; std::getline(file, line); ++number) {
            if (file.eof()) fail("a whole file", "one that ends within line " + text(number));
            if (line.compare(0, 22, "# convention: specular") == 0) specular_ = true;
            if (line[0] != '#') read_row(line, number);
        }
        const std::size_t least = of_directions_ ? 6 : 3, count = rows_.size();
        if (count < 3 || rows_[0].size() < least) fail("3 rows of " + text(least) + " numbers", text(count) + " rows");
        if (of_directions_) check_directions(count - 1); else check_angles(count - 1);
    }

    // Whether the law is one of directions in space: of a surface, or of grooves in random directions.
    bool of_directions() const { return of_directions_; }

    // Of a law in the plane: the outgoing angle for the incoming angle theta, in (0, pi), in the file's convention.
    double sample(double theta, double u) const {
        if (of_directions_) fail("a law in the plane", "one of directions in space");
        if (!(theta > 0.0 && theta < pi)) fail("an incoming angle in (0, pi)", text(theta));
        const double row = theta * (n_in_ / pi) - 0.5, column = unit(u) * (n_out_ - 1);
        const std::size_t i = cell(row, n_in_ - 1), j = cell(column, n_out_ - 1);
        const double s = row - i, t = column - j, *low = &rows_[i + 1][j + 1], *high = &rows_[i + 2][j + 1];
        const double angle = (1 - s) * ((1 - t) * low[0] + t * low[1]) + s * ((1 - t) * high[0] + t * high[1]);
        return std::min(std::max(angle, 1e-300), std::nextafter(pi, 0.0));
    }

    // Replaces the velocity v, whose third component is negative, by that after the reflection; the speed is kept. phi
    // is the angle from the x axis to the grooves, or to the x axis of the surface: draw it uniformly from [0, 2 pi)
    // for random directions. A law in the plane does not use w.
    void reflect(double v[3], double phi, double u, double w) const {
        if (!(v[2] < 0.0)) fail("a velocity with a negative third component", text(v[2]));
        const double c = std::cos(phi), s = std::sin(phi);
        double along = v[0] * c + v[1] * s, left = v[1] * c - v[0] * s;
        if (of_directions_) reflect_in_space(along, left, v[2], unit(u), unit(w)); else reflect_across(left, v[2], u);
        v[0] = along * c - left * s;
        v[1] = along * s + left * c;
    }

private:
    static constexpr double pi = 3.14159265358979323846;
    template <class T> static std::string text(T value) {
        return static_cast<std::ostringstream&&>(std::ostringstream() << value).str();
    }
    [[noreturn]] void fail(const std::string& expected, const std::string& came) const {
        throw std::runtime_error(path_ + ": expected " + expected + ", got " + came);
    }
    double unit(double u) const {
        if (!(u >= 0.0 && u <= 1.0)) fail("a random number in [0, 1)", text(u));
        return u;
    }
    // The cell of a coordinate, of so many cells of size 1 from 0 on.
    static std::size_t cell(double at, std::size_t cells) {
        return static_cast<std::size_t>(std::min(std::max(at, 0.0), static_cast<double>(cells - 1)));
    }

    void read_row(std::string line, std::size_t number) {
        std::replace(line.begin(), line.end(), ',', ' ');
        std::istringstream in(line);
        in.imbue(std::locale::classic());  // the decimal sign is a point
        std::vector<double> row;
        for (double value; in >> value;) row.push_back(value);
        const std::size_t columns = rows_.empty() ? row.size() : rows_[0].size();
        if (!in.eof() || row.size() != columns)
            fail(text(columns) + " numbers in line " + text(number), text(row.size()) + ": " + line.substr(0, 60));
        rows_.push_back(row);
    }

    void check(std::size_t row, std::size_t column, double value) const {
        if (!(std::fabs(rows_[row][column] - value) <= 1e-9))
            fail(text(value) + " as number " + text(column + 1) + " in row " + text(row + 1) + " of numbers, of " +
                     text(rows_.size()) + " with equal steps", text(rows_[row][column]) + " (are rows missing?)");
    }
    void check_angles(std::size_t count) {
        n_in_ = count, n_out_ = rows_[0].size() - 1;
        for (std::size_t i = 0; i < count; ++i) check(i + 1, 0, (i + 0.5) * pi / count);
    }
    void check_directions(std::size_t count) {
        std::size_t same = 0;  // rows of the first incoming normal velocity, and n_out_ of the first azimuth among them
        while (same < count && rows_[same + 1][0] == rows_[1][0]) ++same;
        while (n_out_ < same && rows_[n_out_ + 1][1] == rows_[1][1]) ++n_out_;
        n_in_ = count / same, n_turn_ = same / n_out_;
        if (n_in_ < 2) fail("rows for at least two incoming angles", text(count) + " rows");
        for (std::size_t k = 0; k < count; ++k) {
            check(k + 1, 0, (k / same + 0.5) / n_in_);
            check(k + 1, 1, 2.0 * pi * (k % same / n_out_) / n_turn_);
        }
    }

    // In the plane across the grooves, whose x axis points to the right of them.
    void reflect_across(double& left, double& up, double u) const {
        const double size = std::hypot(left, up), drawn = sample(std::atan2(-up, left), u);
        left = size * (specular_ ? std::cos(drawn) : -std::cos(drawn));
        up = size * std::sin(drawn);
    }
    // Azimuths are from the x axis of the surface; the square is that of the normal component at speed 1.
    void reflect_in_space(double& x, double& y, double& up, double u, double w) const {
        const std::size_t m = rows_[0].size() - 5;
        const double speed = std::hypot(std::hypot(x, y), up), n = up / speed, azimuth = std::atan2(y, x);
        const double row = n * n * n_in_ - 0.5, a = azimuth / (2.0 * pi), column = (a - std::floor(a)) * n_turn_;
        const double p = u * n_out_, q = w * m;
        const std::size_t i = cell(row, n_in_ - 1), t = cell(column, n_turn_ + 1), j = cell(p, n_out_), k = cell(q, m);
        double square = 0.0, turn = azimuth;
        for (std::size_t e = 0; e < 4; ++e) {
            const double weight = (e / 2 ? row - i : 1.0 - (row - i)) * (e % 2 ? column - t : 1.0 - (column - t));
            const double* slice = &rows_[1 + ((i + e / 2) * n_turn_ + (t + e % 2) % n_turn_) * n_out_ + j][2];
            square += weight * (slice[0] + (p - j) * (slice[1] - slice[0]));
            turn += weight * (slice[k + 2] + (q - k) * (slice[k + 3] - slice[k + 2]));
        }
        square = std::min(std::max(square, 1e-300), 1.0);
        x = speed * std::sqrt(1.0 - square) * std::cos(turn);
        y = speed * std::sqrt(1.0 - square) * std::sin(turn);
        up = speed * std::sqrt(square);
    }

    std::string path_;
    bool of_directions_ = false, specular_ = false;
    std::size_t n_in_ = 0, n_turn_ = 1, n_out_ = 0;  // of directions n_out_ counts the slices
    std::vector<std::vector<double>> rows_;
};
}  // namespace asperity

#endif
