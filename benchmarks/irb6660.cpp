// The sensitivities and normal equations of one robot, the ABB IRB 6660-205/1.9, written by hand for eight poses at a time: what a
// compiler makes of the same mathematics where the robot is known to it. Any chain of error frames of this form has its numbers
// (fixed parts, defects, lengths) as arguments; the order of its joints, the coupling of J3 and the four-bar are compiled in.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>
#ifdef __AVX512F__
#include <immintrin.h>
#endif

namespace {

constexpr int LANES = 8, JOINTS = 6, FRAMES = 7, OWN = 45, ALL = 54, BLOCK = 64;

using V = double __attribute__((vector_size(64)));
using I = long __attribute__((vector_size(64)));

V all(double value) { return V{} + value; }

struct Both {
    V cosine, sine;
};

// Cody and Waite's reduction to ±π/4 and fdlibm's minimax polynomials.
Both turn_of(V angle) {
    V n;
    for (int i = 0; i < LANES; ++i) n[i] = std::nearbyint(angle[i] * 0.6366197723675814);
    V r = ((angle - n * 1.5707963267341256) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21, z = r * r;
    V s = r + r * z * (-1.66666666666666324e-01 + z * (8.33333333332248946e-03 + z * (-1.98412698298579493e-04 +
          z * (2.75573137070700677e-06 + z * (-2.50507602534068634e-08 + z * 1.58969099521155010e-10)))));
    V c = 1.0 - 0.5 * z + z * z * (4.16666666666666019e-02 + z * (-1.38888888888741096e-03 + z * (2.48015872894767294e-05 +
          z * (-2.75573143513906633e-07 + z * (2.08757232129817483e-09 - z * 1.13596475577881948e-11)))));
    I quarters = __builtin_convertvector(n, I), odd = (quarters & 1) != 0;
    V cosine = odd ? s : c, sine = odd ? c : s;
    return {(((quarters + 1) & 2) != 0) ? -cosine : cosine, ((quarters & 2) != 0) ? -sine : sine};
}

struct Pose {
    V r[3][3], p[3];
};

struct Frame {
    double t[3], R[3][3], axes[3][3];
    bool zero;
};

struct Axes {
    V axis[JOINTS][3], origin[JOINTS][3];
    V along[FRAMES + 1][3][3], about[FRAMES + 1][3][3], at[FRAMES + 1][3];
};

void move(Pose &T, const double (*M)[4]) {
    for (int a = 0; a < 3; ++a) {
        V u = T.r[a][0], v = T.r[a][1], w = T.r[a][2];
        T.p[a] += u * M[0][3] + v * M[1][3] + w * M[2][3];
        for (int c = 0; c < 3; ++c) T.r[a][c] = u * M[0][c] + v * M[1][c] + w * M[2][c];
    }
}

void turn(Pose &T, V angle, V *axis, V *origin) {
    Both b = turn_of(angle);
    for (int a = 0; a < 3; ++a) {
        axis[a] = T.r[a][2], origin[a] = T.p[a];
        V u = T.r[a][0], v = T.r[a][1];
        T.r[a][0] = b.cosine * u + b.sine * v, T.r[a][1] = b.cosine * v - b.sine * u;
    }
}

void deviate(Pose &T, const Frame &E, V (*along)[3], V (*about)[3], V *at) {
    for (int a = 0; a < 3; ++a) {
        V u = T.r[a][0], v = T.r[a][1], w = T.r[a][2];
        at[a] = T.p[a] += u * E.t[0] + v * E.t[1] + w * E.t[2];
        for (int c = 0; c < 3; ++c) {
            along[c][a] = T.r[a][c];
            about[c][a] = E.zero ? T.r[a][c] : u * E.axes[0][c] + v * E.axes[1][c] + w * E.axes[2][c];
        }
        if (!E.zero)
            for (int c = 0; c < 3; ++c) T.r[a][c] = u * E.R[0][c] + v * E.R[1][c] + w * E.R[2][c];
    }
}

Frame frame_of(const double *e) {
    Frame E;
    double cx = cos(e[3]), sx = sin(e[3]), cy = cos(e[4]), sy = sin(e[4]), cz = cos(e[5]), sz = sin(e[5]);
    double R[3][3] = {{cy * cz, -cy * sz, sy},
                      {cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy},
                      {sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy}};
    double axes[3][3] = {{1, 0, sy}, {0, cx, -sx * cy}, {0, sx, cx * cy}};
    memcpy(E.t, e, sizeof E.t), memcpy(E.R, R, sizeof R), memcpy(E.axes, axes, sizeof axes);
    E.zero = std::all_of(e, e + 6, [](double v) { return v == 0.0; });
    return E;
}

}  // namespace

extern "C" {

struct Robot {
    double fixed[FRAMES][3][4], e[FRAMES][6], offset[JOINTS];
    double crank, rod, rocker, arm, crank_angle, rocker_angle, assembly;
};

struct Measured {
    double base[3][4], base_error[6], target[3];
    const double *points, *whiteners;  // n × 3, n × 3 × 3
};

}

namespace {

struct Walker {
    const Robot &robot;
    Frame frames[FRAMES], base;
    const Measured *measured;
    Axes axes;
    Pose T;
    V by_length[3];

    Walker(const Robot &robot, const Measured *measured) : robot(robot), measured(measured) {
        for (int f = 0; f < FRAMES; ++f) frames[f] = frame_of(robot.e[f]);
        if (measured) base = frame_of(measured->base_error);
    }

    // What the four-bar adds to J3, and its derivatives by crank, rod and rocker.
    V close(V alpha, V kappa) {
        const double L1 = robot.crank, L2 = robot.rod, L3 = robot.rocker, d = robot.arm;
        Both a = turn_of(alpha), k = turn_of(kappa + robot.crank_angle), t = turn_of(kappa + robot.rocker_angle);
        V wx = d * a.cosine - L1 * k.cosine, wy = d * a.sine - L1 * k.sine, square = wx * wx + wy * wy, w, root, angle;
        for (int i = 0; i < LANES; ++i) w[i] = std::sqrt(square[i]);
        V cosine = (L2 * L2 - square - L3 * L3) / (2.0 * L3 * w);
        for (int i = 0; i < LANES; ++i) root[i] = std::sqrt((1.0 - cosine[i]) * (1.0 + cosine[i]));
        V sine = -robot.assembly * root, cl = (wx * cosine - wy * sine) / w, sl = (wy * cosine + wx * sine) / w;
        V vx = wx + L3 * cl, vy = wy + L3 * sl, slope = 1.0 / (L3 * (vy * cl - vx * sl));
        by_length[0] = (vx * k.cosine + vy * k.sine) * slope;
        by_length[1] = L2 * slope;
        by_length[2] = -(vx * cl + vy * sl) * slope;
        V y = sl * t.cosine - cl * t.sine, x = cl * t.cosine + sl * t.sine;
        for (int i = 0; i < LANES; ++i) angle[i] = std::atan2(y[i], x[i]);
        return angle;
    }

    void walk(const double *q, long first, long n) {
        V s[JOINTS];
        for (int i = 0; i < LANES; ++i) {
            const double *row = q + JOINTS * std::min(first + i, n - 1);
            for (int j = 0; j < JOINTS; ++j) s[j][i] = row[j];
        }
        V bent = close(s[1], s[2]) - s[1];
        s[2] += bent;
        for (int a = 0; a < 3; ++a) {
            for (int c = 0; c < 3; ++c) T.r[a][c] = all(a == c);
            T.p[a] = V{};
        }
        if (measured) {
            move(T, measured->base);
            deviate(T, base, axes.along[FRAMES], axes.about[FRAMES], axes.at[FRAMES]);
        }
        for (int j = 0; j < JOINTS; ++j) {
            move(T, robot.fixed[j]);
            turn(T, s[j] + robot.offset[j], axes.axis[j], axes.origin[j]);
            deviate(T, frames[j], axes.along[j], axes.about[j], axes.at[j]);
        }
        move(T, robot.fixed[JOINTS]);
        deviate(T, frames[JOINTS], axes.along[JOINTS], axes.about[JOINTS], axes.at[JOINTS]);
    }

    static void cross(const V *a, const V *o, const V *p, V *out, long stride) {
        V x = p[0] - o[0], y = p[1] - o[1], z = p[2] - o[2];
        out[0] = a[1] * z - a[2] * y, out[stride] = a[2] * x - a[0] * z, out[2 * stride] = a[0] * y - a[1] * x;
    }

    // Columns of the point p: row a, column k at out[a·stride + k].
    void fill(const V *p, V *out, long stride) {
        for (int f = 0; f < FRAMES + (measured ? 1 : 0); ++f) {
            V *J = out + (f < FRAMES ? 6 * f : OWN);
            for (int c = 0; c < 3; ++c) {
                for (int a = 0; a < 3; ++a) J[a * stride + c] = axes.along[f][c][a];
                cross(axes.about[f][c], axes.at[f], p, J + 3 + c, stride);
            }
        }
        V turned[3];
        cross(axes.axis[2], axes.origin[2], p, turned, 1);
        for (int k = 0; k < 3; ++k)
            for (int a = 0; a < 3; ++a) out[a * stride + OWN - 3 + k] = by_length[k] * turned[a];
    }
};

// Eight rows of lanes to eight rows of poses.
void transpose(const V *in, double *out, long stride) {
    V row[LANES];
    for (int i = 0; i < LANES; ++i) row[i] = in[i];
    for (int half = 1; half < LANES; half *= 2) {
        I low, high;
        for (int i = 0; i < LANES; ++i) low[i] = i & half ? i + LANES - half : i, high[i] = i & half ? i + LANES : i + half;
        for (int i = 0; i < LANES; ++i)
            if (!(i & half)) {
                V a = row[i], b = row[i + half];
                row[i] = __builtin_shuffle(a, b, low), row[i + half] = __builtin_shuffle(a, b, high);
            }
    }
    for (int i = 0; i < LANES; ++i) memcpy(out + i * stride, &row[i], sizeof(V));
}

void stream(const double *from, double *to, long count) {
#ifdef __AVX512F__
    if (reinterpret_cast<size_t>(to) % 64 == 0 && count % LANES == 0) {  // the last poses may be fewer than the lanes
        for (long k = 0; k < count; k += LANES) _mm512_stream_pd(to + k, _mm512_load_pd(from + k));
        return;
    }
#endif
    memcpy(to, from, count * sizeof(double));
}

void fill_rows(const Robot &robot, const double *q, long begin, long end, double *J) {
    auto walker = std::make_unique<Walker>(robot, nullptr);
    constexpr int NUMBERS = 3 * OWN;
    alignas(64) V columns[NUMBERS];
    alignas(64) double turned[NUMBERS * LANES];
    for (long first = begin; first < end; first += LANES) {
        walker->walk(q, first, end);
        walker->fill(walker->T.p, columns, OWN);
        for (int k = 0; k < NUMBERS; k += LANES) {
            int row = std::min(k, NUMBERS - LANES);
            transpose(columns + row, turned + row, NUMBERS);
        }
        stream(turned, J + first * NUMBERS, std::min<long>(LANES, end - first) * NUMBERS);
    }
}

constexpr int SIDE = ALL + 2, VECTORS = 3 * BLOCK / LANES;  // 54 columns, the residual and one of zeros: fourteen tiles of four

// Adds the products of all columns of a block, tile by tile, lanes apart.
void add_products(const V (*B)[VECTORS], V (*H)[SIDE]) {
    for (int j = 0; j < SIDE; j += 4)
        for (int k = j; k < SIDE; k += 4) {
            V sum[4][4] = {};
            for (int i = 0; i < VECTORS; ++i)
                for (int a = 0; a < 4; ++a)
                    for (int b = 0; b < 4; ++b) sum[a][b] += B[j + a][i] * B[k + b][i];
            for (int a = 0; a < 4; ++a)
                for (int b = 0; b < 4; ++b) H[j + a][k + b] += sum[a][b];
        }
}

void accumulate(const Robot &robot, const Measured &measured, const double *q, long begin, long end, double *out) {
    auto walker = std::make_unique<Walker>(robot, &measured);
    std::vector<V> products(SIDE * SIDE), block(SIDE * VECTORS);
    auto H = reinterpret_cast<V(*)[SIDE]>(products.data());
    auto B = reinterpret_cast<V(*)[VECTORS]>(block.data());
    alignas(64) V J[3][SIDE];
    for (long start = begin; start < end; start += BLOCK) {
        std::fill(block.begin(), block.end(), V{});
        for (int g = 0; g < BLOCK / LANES && start + g * LANES < end; ++g) {
            long first = start + g * LANES;
            walker->walk(q, first, end);
            const Pose &T = walker->T;
            V p[3], W[3][3] = {};
            for (int a = 0; a < 3; ++a)
                p[a] = T.p[a] + T.r[a][0] * measured.target[0] + T.r[a][1] * measured.target[1] + T.r[a][2] * measured.target[2];
            walker->fill(p, J[0], SIDE);
            for (int a = 0; a < 3; ++a)
                for (int c = 0; c < 3; ++c) J[a][OWN + 6 + c] = T.r[a][c];
            for (int i = 0; i < LANES && first + i < end; ++i)
                for (int a = 0; a < 3; ++a) {
                    p[a][i] = measured.points[3 * (first + i) + a] - p[a][i];
                    for (int b = 0; b <= a; ++b) W[a][b][i] = measured.whiteners[9 * (first + i) + 3 * a + b];
                }
            for (int a = 0; a < 3; ++a) J[a][ALL] = p[a];
            for (int k = 0; k <= ALL; ++k)
                for (int a = 0; a < 3; ++a) {
                    V sum = W[a][0] * J[0][k];
                    for (int b = 1; b <= a; ++b) sum += W[a][b] * J[b][k];
                    B[k][3 * g + a] = sum;
                }
        }
        add_products(B, H);
    }
    for (int j = 0; j <= ALL; ++j)
        for (int k = 0; k <= ALL; ++k) {
            V sum = k / 4 >= j / 4 ? H[j][k] : H[k][j];
            for (int i = 0; i < LANES; ++i) out[j * (ALL + 1) + k] += sum[i];
        }
}

// A thread takes as many poses at a time as Taskcal's do, so that one that is held up does not hold up the other.
template <class Work> void share(long n, int threads, Work work) {
    constexpr long TURN = 8192;
    std::atomic<long> next{0};
    auto take = [&](int t) {
        for (long begin; (begin = next.fetch_add(TURN)) < n;) work(t, begin, std::min(n, begin + TURN));
    };
    std::vector<std::thread> others;
    for (int t = 1; t < threads && t * TURN < n; ++t) others.emplace_back(take, t);
    take(0);
    for (auto &other : others) other.join();
}

}  // namespace

extern "C" {

// J: n × 3 × 45.
void sensitivities(const Robot *robot, const double *q, long n, int threads, double *J) {
    share(n, threads, [=](int, long begin, long end) { fill_rows(*robot, q, begin, end, J); });
}

// out: 55 × 55, products of the 54 columns and the residual, which comes last.
void normal_equations(const Robot *robot, const Measured *measured, const double *q, long n, int threads, double *out) {
    constexpr int SIZE = (ALL + 1) * (ALL + 1);
    std::vector<double> parts(threads * SIZE);
    double *part = parts.data();
    share(n, threads, [=](int t, long begin, long end) { accumulate(*robot, *measured, q, begin, end, part + t * SIZE); });
    std::fill(out, out + SIZE, 0.0);
    for (int i = 0; i < threads * SIZE; ++i) out[i % SIZE] += parts[i];
}

}
