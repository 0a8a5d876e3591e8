/* Poses of the tool at 1 kHz to joints of the calibrated robot:
 *
 *     cc -O2 -I ur5_cell examples/stream_1khz.c ur5_cell/ur5_cell.c -lm -o stream
 *     ./stream < poses.txt > joints.txt
 *
 * The first line has the joints where the robot stands (radians), each other one a pose: three rows of four numbers (metres). */
#define _POSIX_C_SOURCE 200809L
#include "ur5_cell.h"

#include <stdio.h>
#include <time.h>

#define PERIOD_NS 1000000L

static int read_numbers(double *to, int count) {
    int k;
    for (k = 0; k < count; k++)
        if (scanf("%lf", to + k) != 1) return 0;
    return 1;
}

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(void) {
    double q[UR5_CELL_JOINTS], pose[12], worst = 0.0;
    struct timespec next;
    long count = 0;
    if (!read_numbers(q, UR5_CELL_JOINTS)) return fprintf(stderr, "line 1: no joints\n"), 1;
    clock_gettime(CLOCK_MONOTONIC, &next);
    while (read_numbers(pose, 12)) {
        double to[UR5_CELL_JOINTS];
        const double began = seconds();
        const int state = ur5_cell_inverse_near(pose, 0, q, to); /* from the joints before: the same branch */
        const double took = seconds() - began;
        int k;
        count++;
        if (state != UR5_CELL_OK) return fprintf(stderr, "pose %ld: not reached from the one before (%d)\n", count, state), 1;
        if (took > worst) worst = took;
        for (k = 0; k < UR5_CELL_JOINTS; k++) printf("%.12f ", q[k] = to[k]); /* or to the controller */
        putchar('\n');
        next.tv_nsec += PERIOD_NS;
        if (next.tv_nsec >= 1000000000L) next.tv_nsec -= 1000000000L, next.tv_sec++;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, 0);
    }
    fprintf(stderr, "%ld poses, at most %.1f us each\n", count, 1e6 * worst);
    return 0;
}
