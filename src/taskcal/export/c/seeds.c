/* The nominal robot has no closed form here: starts from all over the joint ranges. */

#define STARTS @SEED_COUNT@
#define EACH STARTS
#define WHOLE 0 /* they may lead to some postures only */
#define AGAIN 0
static const double seeds[STARTS][JOINTS] = @SEEDS@;
static const double @P@_limits_middle[JOINTS] = @MIDDLE@;

static int begin(const double *pose, double starts[STARTS][JOINTS], int *near) {
    (void)pose, (void)near;
    memcpy(starts, seeds, sizeof seeds);
    return STARTS;
}

static int regular(const @P@_conditions *c, const double *q) {
    (void)c, (void)q;
    return 0;
}

static int beside(int again, const @P@_conditions *c, double *q) {
    (void)again, (void)c, (void)q;
    return 0;
}
