/* Self-test of @P@.c: @STORED_COUNT@ poses that were stored when it was written. Prints what is off, and returns 1 then. */
#include "@P@.h"

#include <math.h>
#include <stdio.h>

static const struct {
    double q[@JOINTS@], pose[12];
} stored[] = {
    @STORED@};

int main(void) {
    const int count = (int)(sizeof stored / sizeof stored[0]);
    double worst = 0.0, worst_inverse = 0.0;
    int i, k, n, reached = 0;
    for (i = 0; i < count; i++) {
        double pose[12], again[12], q[@GUARD@_BRANCHES][@JOINTS@];
        if (@P@_forward(stored[i].q, 0, pose)) return printf("pose %d is not reached\n", i), 1;
        for (k = 0; k < 12; k++) worst = fmax(worst, fabs(pose[k] - stored[i].pose[k]));
        n = @P@_inverse(stored[i].pose, 0, q, 0);
        reached += n > 0;
        for (; n > 0; n--) {
            @P@_forward(q[n - 1], 0, again);
            for (k = 0; k < 12; k++) worst_inverse = fmax(worst_inverse, fabs(again[k] - stored[i].pose[k]));
        }
    }
    printf("%d poses: forward off by %.1e, inverse found for %d, off by %.1e\n", count, worst, reached, worst_inverse);
    return worst < 1e-12 && worst_inverse < 1e-9 ? 0 : 1;
}
