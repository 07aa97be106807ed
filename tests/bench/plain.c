// The loop that a user would write: velocity Verlet of a chain between walls, or of a ring of bonds, two passes a step.
//   cc -O3 -march=native -fno-math-errno -ffp-contract=off -o plain plain.c -lm && ./plain hertz 200 100000 1.5
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MOST = 4096 };
// u[0] and u[n + 1] are walls, or copies of the beads at the other end; contact c lies between u[c] and u[c + 1]
static double u[MOST], v[MOST], force[MOST], inverse_mass[MOST], stiffness[MOST], rest_overlap[MOST], rest_force[MOST];

static void move(int n, double dt) {
    for (int i = 0; i < n; i++) {
        v[i] += dt * inverse_mass[i] * (force[i] - force[i + 1]);
        u[i + 1] += dt * v[i];
    }
}

static void hertz(int n, double dt) {
    for (int c = 0; c <= n; c++) {
        double overlap = u[c] - u[c + 1] + rest_overlap[c];
        overlap = overlap > 0 ? overlap : 0;
        force[c] = stiffness[c] * overlap * sqrt(overlap) - rest_force[c];
    }
    move(n, dt);
}

static void general(int n, double dt, double alpha) {
    for (int c = 0; c <= n; c++) {
        double overlap = u[c] - u[c + 1] + rest_overlap[c];
        force[c] = (overlap > 0 ? stiffness[c] * pow(overlap, alpha) : 0) - rest_force[c];
    }
    move(n, dt);
}

static void ring(int n, double dt, double quadratic, double cubic) {
    u[0] = u[n];
    u[n + 1] = u[1];
    if (cubic == 0)
        for (int c = 0; c <= n; c++) {
            double x = u[c] - u[c + 1];
            force[c] = stiffness[c] * x + quadratic * x * x;
        }
    else
        for (int c = 0; c <= n; c++) {
            double x = u[c] - u[c + 1];
            force[c] = stiffness[c] * x + cubic * x * x * x;
        }
    move(n, dt);
}

static void toda(int n, double dt, double steepness) {
    u[0] = u[n];
    u[n + 1] = u[1];
    for (int c = 0; c <= n; c++) force[c] = stiffness[c] * (exp(steepness * (u[c] - u[c + 1])) - 1) / steepness;
    move(n, dt);
}

int main(int count, char **words) {
    if (count != 5 || atoi(words[2]) + 2 > MOST) return 2;
    const int n = atoi(words[2]), steps = atoi(words[3]);
    const double alpha = atof(words[4]);
    const int is_toda = !strcmp(words[1], "toda");
    const int is_ring = is_toda || !strcmp(words[1], "alpha") || !strcmp(words[1], "beta");
    for (int i = 0; i <= n; i++) {
        inverse_mass[i] = is_ring ? 1 : 1e3;
        stiffness[i] = is_ring ? 1 : 1e7;
        if (!is_ring) rest_overlap[i] = pow(10 / 1e7, 1 / alpha);
        if (!is_ring) rest_force[i] = 10;
        if (is_ring) u[i + 1] = sin(2 * 3.14159265358979 * i / n);
    }
    if (!is_ring) v[0] = 0.01;
    struct timespec began, ended;
    clock_gettime(CLOCK_MONOTONIC, &began);
    if (!strcmp(words[1], "hertz")) for (int s = 0; s < steps; s++) hertz(n, 2e-7);
    else if (!strcmp(words[1], "power")) for (int s = 0; s < steps; s++) general(n, 2e-7, alpha);
    else if (is_toda) for (int s = 0; s < steps; s++) toda(n, 0.05, 1);
    else if (!strcmp(words[1], "alpha")) for (int s = 0; s < steps; s++) ring(n, 0.05, 0.25, 0);
    else for (int s = 0; s < steps; s++) ring(n, 0.05, 0, 0.25);
    clock_gettime(CLOCK_MONOTONIC, &ended);
    double sum = 0;
    for (int i = 0; i < n; i++) sum += v[i];
    printf("%.9f %g\n", (ended.tv_sec - began.tv_sec) + 1e-9 * (ended.tv_nsec - began.tv_nsec), sum);
    return !isfinite(sum);
}
