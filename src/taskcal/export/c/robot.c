/* @TITLE@; see the header. */
#include "@P@.h"

#include <math.h>
#include <string.h>

#define JOINTS @JOINTS@
#define COORDINATES @COORDINATES@ /* of the chain: joints, and what effects add */
#define FRAMES @FRAMES@           /* in which defects are */
#define PAIRS @PAIRS@             /* of parameters and coordinates that they move */
#define PARAMETERS @PARAMETERS@
#define RANK @RANK@
#define TWO_PI 6.283185307179586

static const @P@_conditions unknown = {{0}, {0}, NAN, NAN};

const char @P@_digest[] = "@DIGEST@";
const double @P@_limits[JOINTS][2] = @LIMITS@;

typedef struct {
    double pose[12];
    double axes[COORDINATES][3], origins[COORDINATES][3];
    double defects[FRAMES][7][3]; /* axes along and about which each frame may stand off, and where */
    double factors[PAIRS];
} walk_t;

static const int slides[COORDINATES] = @SLIDES@;

static inline double above(double value, double least, double then) { return value > least ? then : 0.0; }
static inline double known(double value) { return isnan(value) ? 0.0 : value; }

static int finite_all(const double *values, int count) {
    int k;
    for (k = 0; k < count; k++)
        if (!isfinite(values[k]) || fabs(values[k]) > 1e6) return 0;
    return 1;
}

static int sound(const double *q, const @P@_conditions *c) {
    if (!finite_all(q, JOINTS)) return 0;
    if (c == &unknown) return 1;
    return finite_all(c->approach, JOINTS) && finite_all(c->move, JOINTS) && !isinf(c->temperature) && !isinf(c->time);
}

/* Written from the model, each expression once. */

static int forward(const double *q, const @P@_conditions *c, double *T) {
    (void)c;
    (void)above;
    (void)known;
@FORWARD@
    return @OPEN@;
}

static int differential(const double *q, const @P@_conditions *c, double *T, double *J) {
    (void)c;
@JACOBIAN@
    return @OPEN@;
}

static int stepping(const double *q, const @P@_conditions *c, double *T, double *J) { /* nearly the derivative, for steps */
    (void)c;
@STEPPING@
    return @OPEN@;
}

static int walk(const double *q, const @P@_conditions *c, walk_t *w) {
    (void)c;
@WALK@
    return @OPEN@;
}

int @P@_forward(const double q[JOINTS], const @P@_conditions *conditions, double pose[12]) {
    const @P@_conditions *c = conditions ? conditions : &unknown;
    return sound(q, c) ? forward(q, c, pose) : @GUARD@_NOT_A_NUMBER;
}

int @P@_jacobian(const double q[JOINTS], const @P@_conditions *conditions, double pose[12], double jacobian[6 * JOINTS]) {
    const @P@_conditions *c = conditions ? conditions : &unknown;
    return sound(q, c) ? differential(q, c, pose, jacobian) : @GUARD@_NOT_A_NUMBER;
}

/* Vectors, and rotations in three rows. */

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double *a, const double *b, double *out) {
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x, out[1] = y, out[2] = z;
}

/* Solve the square equations A x = b, of at most six rows, by elimination; 0 where they are singular. */
static int solve(double A[6][6], double *b, int n) {
    int i, j, k;
    for (k = 0; k < n; k++) {
        int best = k;
        for (i = k + 1; i < n; i++)
            if (fabs(A[i][k]) > fabs(A[best][k])) best = i;
        if (!(fabs(A[best][k]) > 1e-300)) return 0;
        if (best != k) {
            double row[6], rest = b[k];
            memcpy(row, A[k], sizeof row);
            memcpy(A[k], A[best], sizeof row);
            memcpy(A[best], row, sizeof row);
            b[k] = b[best], b[best] = rest;
        }
        for (i = k + 1; i < n; i++) {
            const double factor = A[i][k] / A[k][k];
            for (j = k; j < n; j++) A[i][j] -= factor * A[k][j];
            b[i] -= factor * b[k];
        }
    }
    for (k = n - 1; k >= 0; k--) {
        for (j = k + 1; j < n; j++) b[k] -= A[k][j] * b[j];
        b[k] /= A[k][k];
    }
    return 1;
}

/* Twist that is left from a pose to the goal: shift, then rotation vector. */
static void left_over(const double *pose, const double *goal, double *e) {
    double R[9], v[3], sine, cosine, factor;
    int i, j, k;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            for (R[3 * i + j] = 0.0, k = 0; k < 3; k++) R[3 * i + j] += goal[4 * i + k] * pose[4 * j + k];
    v[0] = 0.5 * (R[7] - R[5]), v[1] = 0.5 * (R[2] - R[6]), v[2] = 0.5 * (R[3] - R[1]);
    sine = sqrt(dot(v, v)), cosine = 0.5 * (R[0] + R[4] + R[8] - 1.0);
    factor = sine > 1e-9 ? atan2(sine, cosine) / sine : 1.0;
    for (i = 0; i < 3; i++) e[i] = goal[4 * i + 3] - pose[4 * i + 3], e[3 + i] = factor * v[i];
    if (sine <= 1e-9 && cosine < 0.0) { /* half a turn: about the largest column of R + 1 */
        double column[3];
        int best = R[0] > R[4] ? (R[0] > R[8] ? 0 : 2) : (R[4] > R[8] ? 1 : 2);
        for (i = 0; i < 3; i++) column[i] = R[3 * i + best] + (i == best);
        for (factor = sqrt(dot(column, column)), i = 0; i < 3; i++) e[3 + i] = 0.5 * TWO_PI * column[i] / factor;
    }
}

/* Newton steps from q; 0 once the pose is met. More joints than six take the shortest step, fewer the least error. */
static int newton(const double *goal, const @P@_conditions *c, double *q) {
    double pose[12], J[6 * JOINTS], e[6], A[6][6], b[6], step[JOINTS];
    int turn, i, j, k;
    for (turn = 0; turn < 40; turn++) {
        double largest = 0.0, damping;
        const int state = stepping(q, c, pose, J);
        if (state) return state;
        left_over(pose, goal, e);
        if (dot(e, e) < 1e-20 && dot(e + 3, e + 3) < 1e-20) return @GUARD@_OK;
        damping = turn < 20 ? 1e-12 : 1e-6;
        memset(A, 0, sizeof A);
        if (JOINTS >= 6) {
            for (i = 0; i < 6; i++) {
                for (j = 0; j <= i; A[j][i] = A[i][j], j++)
                    for (k = 0; k < JOINTS; k++) A[i][j] += J[i * JOINTS + k] * J[j * JOINTS + k];
                A[i][i] += damping;
                b[i] = e[i];
            }
            if (!solve(A, b, 6)) return @GUARD@_OUT_OF_REACH;
            for (k = 0; k < JOINTS; k++)
                for (step[k] = 0.0, i = 0; i < 6; i++) step[k] += J[i * JOINTS + k] * b[i];
        } else {
            for (i = 0; i < JOINTS && i < 6; i++) {
                for (j = 0; j < JOINTS && j < 6; j++)
                    for (k = 0; k < 6; k++) A[i][j] += J[k * JOINTS + i] * J[k * JOINTS + j];
                A[i][i] += damping;
                for (b[i] = 0.0, k = 0; k < 6; k++) b[i] += J[k * JOINTS + i] * e[k];
            }
            if (!solve(A, b, JOINTS < 6 ? JOINTS : 6)) return @GUARD@_OUT_OF_REACH;
            for (k = 0; k < JOINTS && k < 6; k++) step[k] = b[k];
        }
        for (k = 0; k < JOINTS; k++)
            if (fabs(step[k]) > largest) largest = fabs(step[k]);
        for (k = 0; k < JOINTS; k++) q[k] += largest > 0.5 ? step[k] * 0.5 / largest : step[k];
    }
    return @GUARD@_OUT_OF_REACH;
}

static const double coupled[@COUPLED@][JOINTS + 2] = @COUPLED_LIMITS@; /* factors of joints whose sum is limited, low, high */

/* Number of the first joint outside its limits, or the last of those whose sum is; -1 inside. */
static int outside_limits(const double *q) {
    int i, k;
    for (k = 0; k < JOINTS; k++)
        if (!(q[k] >= @P@_limits[k][0] - 1e-9 && q[k] <= @P@_limits[k][1] + 1e-9)) return k;
    for (i = 0; i < @COUPLED@; i++) {
        double sum = 0.0;
        int last = 0;
        for (k = 0; k < JOINTS; k++) {
            sum += coupled[i][k] * q[k];
            if (coupled[i][k] != 0.0) last = k;
        }
        if (!(sum >= coupled[i][JOINTS] - 1e-9 && sum <= coupled[i][JOINTS + 1] + 1e-9)) return last;
    }
    return -1;
}

/* Move joints by whole turns into their limits, nearest to the middle of these; number of the first that has none inside, or -1. */
static int into_limits(double *q) {
    int k;
    for (k = 0; k < JOINTS; k++) {
        const double low = @P@_limits[k][0], high = @P@_limits[k][1];
        if (!slides[k]) {
            const double off = isfinite(low + high) ? 0.5 * (low + high) : 0.0;
            const double q_near = q[k] - TWO_PI * floor((q[k] - off) / TWO_PI + 0.5);
            q[k] = q_near;
            if (q[k] < low - 1e-9) q[k] += TWO_PI * ceil((low - 1e-9 - q[k]) / TWO_PI);
            if (q[k] > high + 1e-9) q[k] -= TWO_PI * ceil((q[k] - high - 1e-9) / TWO_PI);
        }
    }
    return outside_limits(q);
}

int @P@_inverse_near(const double pose[12], const @P@_conditions *conditions, const double start[JOINTS], double q[JOINTS]) {
    const @P@_conditions *c = conditions ? conditions : &unknown;
    int state;
    if (!sound(start, c) || !finite_all(pose, 12)) return @GUARD@_NOT_A_NUMBER;
    memmove(q, start, JOINTS * sizeof *q);
    state = newton(pose, c, q);
    return state == @GUARD@_OK && outside_limits(q) >= 0 ? @GUARD@_OUT_OF_LIMITS : state;
}

@BRANCHES@

/* Whether the closed loop of its drive assembles neither at a posture nor beside it. */
static int open_about(const @P@_conditions *c, const double *q) {
    double pose[12], one[JOINTS];
    int k;
    if (forward(q, c, pose) != @GUARD@_OPEN) return 0;
    for (k = 0; k < 2 * JOINTS; k++) {
        memcpy(one, q, sizeof one);
        one[k / 2] += k % 2 ? 0.05 : -0.05;
        if (forward(one, c, pose) != @GUARD@_OPEN) return 0;
    }
    return 1;
}

/* Whether two postures are one, whole turns aside. */
static int alike(const double *a, const double *b) {
    double far = 0.0;
    int k;
    for (k = 0; k < JOINTS; k++) {
        const double off = a[k] - b[k];
        far = fmax(far, fabs(slides[k] ? off : off - TWO_PI * floor(off / TWO_PI + 0.5)));
    }
    return far < 1e-6;
}

int @P@_inverse(const double pose[12], const @P@_conditions *conditions, double q[@GUARD@_BRANCHES][JOINTS], int *said) {
    const @P@_conditions *c = conditions ? conditions : &unknown;
    double starts[STARTS][JOINTS], found[2 * STARTS][JOINTS];
    int sure[STARTS], count = 0, reached = 0, outside = -1, near = 0, all, i, j, n, again;
    if (said) *said = -1;
    if (!sound(@P@_limits_middle, c) || !finite_all(pose, 12)) return @GUARD@_NOT_A_NUMBER;
    n = begin(pose, starts, &near);
    for (i = 0; i < n; i++) sure[i] = 0;
    for (again = 0; again <= (n > EACH ? 0 : AGAIN); again++)
        for (i = 0; i < n && reached < 2 * STARTS && count < @GUARD@_BRANCHES; i++) {
            double one[JOINTS], before[JOINTS];
            int bad;
            if (sure[i]) continue;
            memcpy(one, starts[i], sizeof one);
            if (again && !beside(again, c, one)) continue;
            into_limits(one);
            if (!again && (sure[i] = open_about(c, one))) continue;
            if (newton(pose, c, one)) continue;
            memcpy(before, one, sizeof before);
            bad = into_limits(one);
            if (bad < 0 && memcmp(before, one, sizeof before) && newton(pose, c, one)) continue; /* effects may change by a turn */
            for (j = 0; j < reached && !alike(found[j], one); j++) {}
            if (j < reached) continue;
            memcpy(found[reached++], one, sizeof one);
            if (!again) sure[i] = regular(c, one), memcpy(starts[i], one, sizeof one);
            if (bad < 0) memcpy(q[count++], one, sizeof one);
            if (bad >= 0 && outside < 0) outside = bad;
        }
    for (all = WHOLE && !near, i = 0; i < n; i++) all = all && sure[i];
    if (said) *said = !count ? outside : all ? @GUARD@_ALL : @GUARD@_MAY_BE_MORE;
    if (count || (WHOLE && !all)) return count;
    return reached ? @GUARD@_OUT_OF_LIMITS : @GUARD@_OUT_OF_REACH;
}

/* Uncertainty: the covariance of the parameters is F Ft. */

static const double low[JOINTS] = @LOW@, high[JOINTS] = @HIGH@; /* where joints were measured */
static const int by_turns[JOINTS] = @BY_TURNS@;                 /* a whole turn of these changes nothing */
static const double joint_error[JOINTS] = @JOINT_ERROR@;
static const short slots[FRAMES][6] = @SLOTS@; /* parameter of each defect, or -1 */
static const short pairs[PAIRS][2] = @PAIR_TABLE@;
static const double F[PARAMETERS][RANK] = @FACTOR@;

static int told(const @P@_conditions *c) { /* whether all is known that the model asks for */
    int k, approached = 1, moved = 0;
    for (k = 0; k < JOINTS; k++) approached = approached && c->approach[k] != 0.0, moved = moved || c->move[k] != 0.0;
    return (!@ASKS_APPROACH@ || approached) && (!@ASKS_MOVE@ || moved) && (!@ASKS_TEMPERATURE@ || !isnan(c->temperature)) &&
           (!@ASKS_TIME@ || !isnan(c->time));
}

static double beyond(const double *q) {
    double sum = 0.0;
    int k;
    for (k = 0; k < JOINTS; k++) {
        const double at = by_turns[k] ? q[k] - TWO_PI * floor((q[k] - 0.5 * (low[k] + high[k])) / TWO_PI + 0.5) : q[k];
        const double off = (fmin(at - low[k], 0.0) + fmax(at - high[k], 0.0)) / fmax(high[k] - low[k], 0.2);
        sum += off * off;
    }
    return sum;
}

static void along(const walk_t *w, int coordinate, const double *tip, double *v) {
    double arm[3];
    int a;
    for (a = 0; a < 3; a++) arm[a] = tip[a] - w->origins[coordinate][a], v[a] = w->axes[coordinate][a];
    if (!slides[coordinate]) cross(w->axes[coordinate], arm, v);
}

static void add(double moved[3][RANK], const double *v, int parameter) {
    int a, r;
    for (a = 0; a < 3; a++)
        for (r = 0; r < RANK; r++) moved[a][r] += v[a] * F[parameter][r];
}

int @P@_uncertainty(const double q[JOINTS], const @P@_conditions *conditions, const double point[3], double covariance[9], double *outside) {
    const @P@_conditions *c = conditions ? conditions : &unknown;
    walk_t w;
    double moved[3][RANK], tip[3], arm[3], v[3], growth;
    int state, a, b, f, k, r;
    if (!sound(q, c) || !finite_all(point, 3)) return @GUARD@_NOT_A_NUMBER;
    if (!told(c)) return @GUARD@_UNKNOWN;
    state = walk(q, c, &w);
    if (state) return state;
    memset(moved, 0, sizeof moved);
    for (a = 0; a < 3; a++) tip[a] = w.pose[4 * a + 3] + dot(w.pose + 4 * a, point);
    for (f = 0; f < FRAMES; f++)
        for (k = 0; k < 6; k++) {
            if (slots[f][k] < 0) continue;
            for (a = 0; a < 3; a++) v[a] = w.defects[f][k][a], arm[a] = tip[a] - w.defects[f][6][a];
            if (k >= 3) cross(w.defects[f][k], arm, v);
            add(moved, v, slots[f][k]);
        }
    for (k = 0; k < @USED_PAIRS@; k++) {
        along(&w, pairs[k][0], tip, v);
        for (a = 0; a < 3; a++) v[a] *= w.factors[k];
        add(moved, v, pairs[k][1]);
    }
    growth = 1.0 + @GROWTH@ * beyond(q);
    if (outside) *outside = sqrt(beyond(q));
    for (a = 0; a < 9; a++) covariance[a] = a % 4 ? 0.0 : @MODEL_VARIANCE@;
    for (a = 0; a < 3; a++)
        for (b = 0; b < 3; b++)
            for (r = 0; r < RANK; r++) covariance[3 * a + b] += moved[a][r] * moved[b][r];
    for (k = 0; k < JOINTS; k++) {
        along(&w, k, tip, v);
        for (a = 0; a < 3; a++) v[a] *= joint_error[k];
        for (a = 0; a < 9; a++) covariance[a] += v[a / 3] * v[a % 3];
    }
    for (a = 0; a < 9; a++) covariance[a] *= growth;
    return @GUARD@_OK;
}
