/* Postures of the nominal robot in closed form: axes and points of its joints where all coordinates are zero, and the tool. */

#define STARTS 64 /* more than for each posture beside a singular wrist */
#define EACH 8    /* one for each posture */
#define WHOLE 1
#define AGAIN 6   /* times that a start is moved that led to no posture of its own, or to one that is nearly singular */
#define APART 0.05     /* half of the angle between two postures of a start, at least: of a stretched arm both are found */
#define NEAR 0.06      /* sine of a wrist that defects may turn over */
#define REGULAR 0.003  /* share of `least` from which on defects of a milliradian leave a posture alone */
static const double H[6][3] = @AXES@, P[6][3] = @POINTS@, home[12] = @HOME@;
static const double meeting[3] = @MEETING@; /* of the last axes */
static const double unmix[6][6] = @UNMIX@, offset[6] = @OFFSET@; /* joints are unmix (coordinates - offset) */
static const double @P@_limits_middle[JOINTS] = @MIDDLE@;

static void turned(const double *axis, double angle, const double *p, double *out) {
    const double c = cos(angle), s = sin(angle), along = (1.0 - c) * dot(axis, p);
    double w[3];
    int a;
    cross(axis, p, w);
    for (a = 0; a < 3; a++) out[a] = c * p[a] + s * w[a] + along * axis[a];
}

/* Angle about an axis from one vector to another. */
static double angle_between(const double *axis, const double *from, const double *to) {
    double w[3];
    cross(from, to, w);
    return atan2(dot(axis, w), dot(from, to) - dot(axis, from) * dot(axis, to));
}

/* Angles about an axis at which a vector p has the component d along h; the nearest where it has it nowhere. 0 where it is so far
 * from it that no defects bring it there, and steps would be for nothing. */
static int both_angles(const double *h, const double *axis, const double *p, double d, double *out) {
    double w[3], A, B, size, ratio, turn;
    cross(axis, p, w);
    A = dot(h, p) - dot(h, axis) * dot(axis, p), B = dot(h, w);
    size = sqrt(A * A + B * B);
    ratio = size > 1e-12 ? (d - dot(h, axis) * dot(axis, p)) / size : 0.0;
    turn = fmax(APART, fmin(0.5 * TWO_PI - APART, acos(fmax(-1.0, fmin(1.0, ratio)))));
    out[0] = atan2(B, A) + turn, out[1] = atan2(B, A) - turn;
    return fabs(ratio) < 1.05;
}

static void about(int joint, double angle, const double *p, double *out) { /* a point, by a joint */
    double arm[3];
    int a;
    for (a = 0; a < 3; a++) arm[a] = p[a] - P[joint][a];
    turned(H[joint], angle, arm, out);
    for (a = 0; a < 3; a++) out[a] += P[joint][a];
}

/* Angles of joints 2 and 3 that bring a point p, behind joint 3, to v: joint 3 by the distance from axis 2. */
static int elbow(const double *p, const double *v, double s2[2], double s3[2]) {
    double a[3], b[3], to[3], from[3];
    int i, k;
    for (i = 0; i < 3; i++) a[i] = P[2][i] - P[1][i], b[i] = p[i] - P[2][i], to[i] = v[i] - P[1][i];
    if (!both_angles(a, H[2], b, 0.5 * (dot(to, to) - dot(a, a) - dot(b, b)), s3)) return 0;
    for (k = 0; k < 2; k++) {
        about(2, s3[k], p, from);
        for (i = 0; i < 3; i++) from[i] -= P[1][i];
        s2[k] = angle_between(H[1], from, to);
    }
    return 1;
}

static void into_joints(const double *s, double *q) {
    int i, k;
    for (i = 0; i < 6; i++)
        for (q[i] = 0.0, k = 0; k < 6; k++) q[i] += unmix[i][k] * (s[k] - offset[k]);
}

static void columns_turned(int joint, double angle, double G[3][3], double out[3][3]) { /* vectors, one a row */
    int a;
    for (a = 0; a < 3; a++) turned(H[joint], angle, G[a], out[a]);
}

/* Starts of the Newton steps, one for each posture of the nominal robot; a pose goes to the others by e1 ... e6 home. */
static int begin(const double *pose, double starts[STARTS][JOINTS], int *near) {
    double R[3][3], w[3], arm[3], s1[2], v[3], h1[3];
    int i, j, k, n = 0, a;
    for (i = 0; i < 3; i++) arm[i] = meeting[i] - home[4 * i + 3], h1[i] = -H[0][i];
    for (i = 0; i < 3; i++) /* R turns home into the pose; here by columns, R[j] is where axis j goes */
        for (j = 0; j < 3; j++)
            for (R[j][i] = 0.0, k = 0; k < 3; k++) R[j][i] += pose[4 * i + k] * home[4 * j + k];
    for (i = 0; i < 3; i++) w[i] = pose[4 * i + 3] + R[0][i] * arm[0] + R[1][i] * arm[1] + R[2][i] * arm[2];
    for (a = 0; a < 3; a++) v[a] = w[a] - P[0][a], arm[a] = meeting[a] - P[0][a];
    if (!both_angles(H[1], h1, v, dot(H[1], arm), s1)) return 0;
    for (i = 0; i < 2; i++) {
        double G[3][3], s2[2], s3[2];
        about(0, -s1[i], w, v);
        columns_turned(0, -s1[i], R, G);
@ORDER@
    }
    return n;
}

/* Direction in which the joints do the least to the tool, of length 1; returns how much, as a share of all. */
static double least(const @P@_conditions *c, const double *q, double *v) {
    double pose[12], J[36], M[6][6], A[6][6], all = 0.0, size = 1.0;
    int i, j, k, turn;
    if (stepping(q, c, pose, J)) return 0.0;
    for (i = 0; i < 6; i++) {
        v[i] = i % 2 ? -0.4 : 0.4;
        for (j = 0; j < 6; j++)
            for (M[i][j] = i == j ? 1e-12 : 0.0, k = 0; k < 6; k++) M[i][j] += J[6 * k + i] * J[6 * k + j];
        all += M[i][i];
    }
    for (turn = 0; turn < 3; turn++) { /* the inverse of JtJ turns any vector there */
        memcpy(A, M, sizeof A);
        if (!solve(A, v, 6)) return 0.0;
        for (size = 0.0, i = 0; i < 6; i++) size += v[i] * v[i];
        for (size = sqrt(size), i = 0; i < 6; i++) v[i] /= size;
    }
    return 1.0 / sqrt(size * all);
}

/* Whether a posture is so far from singular ones that defects leave it and no other beside it. */
static int regular(const @P@_conditions *c, const double *q) {
    double v[6];
    return least(c, q, v) > REGULAR;
}

/* Move a start along it: near a singular posture Newton steps part there. */
static int beside(int again, const @P@_conditions *c, double *q) {
    static const double far[AGAIN] = {0.4, -0.4, 1.1, -1.1, 2.2, -2.2};
    double v[6];
    int i;
    if (!(least(c, q, v) > 0.0)) return 0;
    for (i = 0; i < 6; i++) q[i] += far[again - 1] * v[i];
    return 1;
}
