/* @ABOUT@ */
#include "@FILE@.h"

#include <math.h>
#include <string.h>

enum { OK, OUTSIDE, OPEN, INDEFINITE };
enum { LINEAR, PRODUCT, POWER, SINE, COSINE, EXPONENTIAL, SOLVE, CLOSE };
enum { BEGIN, END, ARGUMENTS, VALUES, UNKNOWNS, EQUATIONS, CHECKS, ABOUT };

/* --- The model: functions as lists of operations, triangles of the terms of K and M */

@ARRAYS@

/* --- Small dense algebra, row by row */

/* Solve A X = B (n, m) in place by elimination; 0 where A is singular. */
static int solved(int n, int m, double *A, double *B)
{
    for (int c = 0; c < n; c++) {
        int best = c;
        for (int i = c + 1; i < n; i++)
            if (fabs(A[i * n + c]) > fabs(A[best * n + c])) best = i;
        if (!(fabs(A[best * n + c]) > 0.0)) return 0;
        for (int j = 0; best != c && j < n; j++) {
            double t = A[c * n + j];
            A[c * n + j] = A[best * n + j];
            A[best * n + j] = t;
        }
        for (int j = 0; best != c && j < m; j++) {
            double t = B[c * m + j];
            B[c * m + j] = B[best * m + j];
            B[best * m + j] = t;
        }
        for (int i = c + 1; i < n; i++) {
            double factor = A[i * n + c] / A[c * n + c];
            for (int j = c + 1; j < n; j++) A[i * n + j] -= factor * A[c * n + j];
            for (int j = 0; j < m; j++) B[i * m + j] -= factor * B[c * m + j];
        }
    }
    for (int i = n - 1; i >= 0; i--)
        for (int j = 0; j < m; j++) {
            for (int c = i + 1; c < n; c++) B[i * m + j] -= A[i * n + c] * B[c * m + j];
            B[i * m + j] /= A[i * n + i];
        }
    return 1;
}

/* Lower L of A = L L' in place; 0 where A is not positive definite. */
static int cholesky(int n, double *A, int stride)
{
    for (int j = 0; j < n; j++)
        for (int i = j; i < n; i++) {
            double sum = A[i * stride + j];
            for (int c = 0; c < j; c++) sum -= A[i * stride + c] * A[j * stride + c];
            if (i == j && !(sum > 0.0)) return 0;
            A[i * stride + j] = i == j ? sqrt(sum) : sum / A[j * stride + j];
        }
    return 1;
}

/* Eigenvalues d[n] of symmetric A, which is lost: Householder's reflections, then implicit QL. */
static int eigenvalues(int n, double *A, double *d, double *e)
{
    for (int i = n - 1; i > 0; i--) {
        double norm = 0.0, sigma = 0.0, beta = 0.0, *u = A + i * n;
        for (int c = 0; c < i; c++) sigma += u[c] * u[c];
        norm = u[i - 1] > 0.0 ? -sqrt(sigma) : sqrt(sigma);
        d[i] = A[i * n + i];
        e[i] = norm;
        double half = sigma - u[i - 1] * norm; /* |u|^2 / 2 once u[i - 1] has lost its norm */
        if (!(half > 0.0)) continue;
        u[i - 1] -= norm;
        for (int r = 0; r < i; r++) {
            double sum = 0.0;
            for (int c = 0; c <= r; c++) sum += A[r * n + c] * u[c];
            for (int c = r + 1; c < i; c++) sum += A[c * n + r] * u[c];
            d[r] = sum / half;
            beta += d[r] * u[r];
        }
        beta /= 2.0 * half;
        for (int r = 0; r < i; r++) d[r] -= beta * u[r];
        for (int r = 0; r < i; r++)
            for (int c = 0; c <= r; c++) A[r * n + c] -= u[r] * d[c] + d[r] * u[c];
    }
    d[0] = A[0];
    for (int i = 1; i < n; i++) e[i - 1] = e[i];
    e[n - 1] = 0.0;
    for (int l = 0; l < n; l++)
        for (int turn = 0;; turn++) {
            int m = l;
            for (; m < n - 1; m++) {
                double size = fabs(d[m]) + fabs(d[m + 1]);
                if (fabs(e[m]) + size == size) break;
            }
            if (m == l) break;
            if (turn == 60) return 0;
            double g = (d[l + 1] - d[l]) / (2.0 * e[l]), r = hypot(g, 1.0);
            g = d[m] - d[l] + e[l] / (g + (g >= 0.0 ? r : -r));
            double s = 1.0, c = 1.0, p = 0.0;
            int i = m - 1;
            for (; i >= l; i--) {
                double f = s * e[i], b = c * e[i];
                r = hypot(f, g);
                e[i + 1] = r;
                if (r == 0.0) {
                    d[i + 1] -= p;
                    e[m] = 0.0;
                    break;
                }
                s = f / r;
                c = g / r;
                g = d[i + 1] - p;
                r = (d[i] - g) * s + 2.0 * c * b;
                p = s * r;
                d[i + 1] = g + p;
                g = c * r - b;
            }
            if (r == 0.0 && i >= l) continue;
            d[l] -= p;
            e[l] = g;
            e[m] = 0.0;
        }
    return 1;
}

/* --- The functions theta(q, y), and loops that are closed by equations */

static int closed(int f, const double *a, double *p);

static int run(int f, const double *arguments, double *out)
{
    const int *about = FUNCTIONS + f * ABOUT;
    double v[MOST_VALUES], A[MOST_SYSTEM], B[MOST_SYSTEM];
    int count = about[ARGUMENTS];
    memcpy(v, arguments, (size_t)count * sizeof *v);
    for (int k = about[BEGIN]; k < about[END]; k++) {
        const int *atom = ATOMS + FIRST_ATOM[k], size = FIRST_ATOM[k + 1] - FIRST_ATOM[k];
        const double *weight = WEIGHTS + FIRST_ATOM[k];
        double number = NUMBERS[k];
        switch (KINDS[k]) {
        case LINEAR:
            v[count] = number;
            for (int i = 0; i < size; i++) v[count] += weight[i] * v[atom[i]];
            count++;
            break;
        case PRODUCT: v[count++] = v[atom[0]] * v[atom[1]]; break;
        case POWER: v[count++] = pow(v[atom[0]], number); break;
        case SINE: v[count++] = sin(v[atom[0]]); break;
        case COSINE: v[count++] = cos(v[atom[0]]); break;
        case EXPONENTIAL: v[count++] = exp(v[atom[0]]); break;
        case SOLVE: {
            int n = (int)number, rest = size - n * n;
            for (int i = 0; i < n * n; i++) A[i] = v[atom[i]];
            for (int i = 0; i < rest; i++) B[i] = v[atom[n * n + i]];
            if (!solved(n, rest / n, A, B)) return OPEN;
            for (int i = 0; i < rest; i++) v[count++] = B[i];
            break;
        }
        default: {
            int inner = (int)number, status;
            for (int i = 0; i < size; i++) A[i] = v[atom[i]];
            if ((status = closed(inner, A, v + count)) != OK) return status;
            count += FUNCTIONS[inner * ABOUT + UNKNOWNS];
        }
        }
    }
    for (int i = FIRST_OUTPUT[f]; i < FIRST_OUTPUT[f + 1]; i++)
        *out++ = v[OUTPUTS[i]];
    return OK;
}

/* Rows F, check and J = dF/dp; the least and the largest singular value of J. */
static int equations(int f, const double *a, const double *p, double *rows, double s[2])
{
    const int *about = FUNCTIONS + f * ABOUT;
    int n = about[UNKNOWNS], m = about[EQUATIONS], first = m + about[CHECKS];
    double x[MOST_VALUES], square[MOST_SYSTEM], d[MOST_UNKNOWNS], e[MOST_UNKNOWNS];
    const double *J = rows + first;
    memcpy(x, a, (size_t)(about[ARGUMENTS] - n) * sizeof *x);
    memcpy(x + about[ARGUMENTS] - n, p, (size_t)n * sizeof *x);
    if (run(f, x, rows) != OK) return 0;
    for (int i = 0; i < first + m * n; i++)
        if (!isfinite(rows[i])) return 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            square[i * n + j] = 0.0;
            for (int k = 0; k < m; k++) square[i * n + j] += J[k * n + i] * J[k * n + j];
        }
    if (!eigenvalues(n, square, d, e)) return 0;
    s[0] = s[1] = d[0];
    for (int i = 1; i < n; i++) {
        s[0] = fmin(s[0], d[i]);
        s[1] = fmax(s[1], d[i]);
    }
    s[0] = sqrt(fmax(s[0], 0.0));
    s[1] = sqrt(s[1]);
    return 1;
}

/* p of F(p, a) = 0 in equal steps from the known a_0; 0 where a step might leave the branch. */
static int followed(int f, const double *a, double *p, int steps)
{
    const int *about = FUNCTIONS + f * ABOUT;
    int n = about[UNKNOWNS], m = about[EQUATIONS], first = m + about[CHECKS];
    int inputs = about[ARGUMENTS] - n;
    const double *a0 = KNOWN + FIRST_KNOWN[f];
    double rows[MOST_ROWS], before[MOST_ROWS], here[MOST_VALUES], s[2], smallest;
    double A[MOST_SYSTEM], B[MOST_UNKNOWNS];
    memcpy(p, a0 + inputs, (size_t)n * sizeof *p);
    if (!equations(f, a0, p, rows, s)) return 0;
    smallest = s[0];
    for (int k = 1; k <= steps; k++) {
        double t = (double)k / steps, tolerance = k == steps ? 1e-13 : 1e-6, moved = 0.0, far = 0.0;
        memcpy(before, rows, (size_t)(first + m * n) * sizeof *before);
        for (int i = 0; i < inputs; i++) here[i] = a0[i] + t * (a[i] - a0[i]);
        for (int turn = 0; turn < 12; turn++) {
            const double *J = rows + first;
            if (!equations(f, here, p, rows, s)) return 0;
            for (int i = 0; i < n; i++) { /* of least |J step + F|: normal equations if m > n */
                B[i] = m == n ? rows[i] : 0.0;
                for (int j = 0; j < n; j++) A[i * n + j] = m == n ? J[i * n + j] : 0.0;
                for (int c = 0; m != n && c < m; c++) {
                    B[i] += J[c * n + i] * rows[c];
                    for (int j = 0; j < n; j++) A[i * n + j] += J[c * n + i] * J[c * n + j];
                }
            }
            if (!solved(n, 1, A, B)) return 0;
            moved = 0.0;
            for (int i = 0; i < n; i++) {
                moved = fmax(moved, fabs(B[i]));
                p[i] -= fmax(-0.5, fmin(0.5, B[i]));
            }
            if (moved < tolerance) break;
        }
        for (int i = first; i < first + m * n; i++)
            far += (rows[i] - before[i]) * (rows[i] - before[i]);
        if (!(moved < fmax(tolerance, 1e-8) && s[0] > 1e-5 * s[1] && sqrt(far) < smallest))
            return 0;
        smallest = s[0];
    }
    if (!equations(f, a, p, rows, s)) return 0;
    for (int i = 0; i < first; i++)
        if (!(fabs(rows[i]) < 1e-9)) return 0;
    return 1;
}

static int closed(int f, const double *a, double *p)
{
    const int *about = FUNCTIONS + f * ABOUT;
    const double *a0 = KNOWN + FIRST_KNOWN[f];
    double far = 0.0;
    for (int i = 0; i < about[ARGUMENTS] - about[UNKNOWNS]; i++) {
        if (!(fabs(a[i] - a0[i]) < 500.0)) return OPEN;
        far = fmax(far, fabs(a[i] - a0[i]));
    }
    int steps = far > 0.0 ? (int)ceil(far / 0.15) : 1;
    for (int refinement = 1; refinement <= 64; refinement *= 4)
        if (followed(f, a, p, refinement * steps)) return OK;
    return OPEN;
}

/* --- The reduced matrices, and their eigenvalues */

static void summed(const int *terms, int n_terms, const double *triangles, const double *theta,
                   int n, double *A)
{
    memset(A, 0, (size_t)(n * n) * sizeof *A);
    for (int t = 0; t < n_terms; t++)
        for (int i = 0; i < n; i++)
            for (int j = 0; j <= i; j++) A[i * n + j] += theta[terms[t]] * *triangles++;
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++) A[i * n + j] = A[j * n + i];
}

int @NAME@_matrices(const double *q, const double *y, double *K, double *M)
{
    double z[N_Z + 1], theta[N_THETA], all[N_ALL * N_ALL];
    int status;
    for (int j = 0; j < N_Q + N_Y; j++) {
        double x = j < N_Q ? q[j] : y[j - N_Q];
        if (!(x >= LOWER[j] && x <= UPPER[j])) return OUTSIDE;
    }
    for (int i = 0; i < N_Z; i++) {
        z[i] = SHIFT[i];
        for (int j = 0; j < N_Q; j++) z[i] += TO_PROGRAM[i * (N_Q + N_Y) + j] * q[j];
        for (int j = 0; j < N_Y; j++) z[i] += TO_PROGRAM[i * (N_Q + N_Y) + N_Q + j] * y[j];
    }
    theta[0] = 1.0;
    if ((status = run(0, z, theta + 1)) != OK) return status;
    for (int i = 0; i < N_THETA; i++)
        if (!isfinite(theta[i])) return OUTSIDE;
    summed(STIFFNESS_TERMS, N_STIFFNESS, STIFFNESS, theta, SIZE, K);
    summed(MASS_TERMS, N_MASS, MASS, theta, N_ALL, all);
    double *coupling = all + (N_ALL - RIGID) * N_ALL; /* M_FE, and behind it M_FF */
    double *L = RIGID ? coupling + SIZE : all;
    if (!cholesky(RIGID, L, N_ALL)) return INDEFINITE;
    for (int i = 0; i < RIGID; i++)
        for (int j = 0; j < SIZE; j++) {
            for (int c = 0; c < i; c++)
                coupling[i * N_ALL + j] -= L[i * N_ALL + c] * coupling[c * N_ALL + j];
            coupling[i * N_ALL + j] /= L[i * N_ALL + i];
        }
    for (int i = 0; i < SIZE; i++)
        for (int j = 0; j < SIZE; j++) {
            M[i * SIZE + j] = all[i * N_ALL + j];
            for (int c = 0; c < RIGID; c++)
                M[i * SIZE + j] -= coupling[c * N_ALL + i] * coupling[c * N_ALL + j];
        }
    return OK;
}

int @NAME@_frequencies(const double *q, const double *y, double *hz)
{
    double K[SIZE * SIZE], M[SIZE * SIZE], mu[SIZE], e[SIZE];
    for (int i = 0; i < N_MODES; i++) hz[i] = NAN;
    int status = @NAME@_matrices(q, y, K, M);
    if (status != OK) return status;
    if (!cholesky(SIZE, K, SIZE)) return INDEFINITE;
    for (int turn = 0; turn < 2; turn++) /* M <- (L^-1 M)' twice is L^-1 M L^-T */
        for (int j = 0; j < SIZE; j++)
            for (int i = 0; i < SIZE; i++) {
                double *at = turn ? M + j * SIZE : M + j;
                int stride = turn ? 1 : SIZE;
                for (int c = 0; c < i; c++) at[i * stride] -= K[i * SIZE + c] * at[c * stride];
                at[i * stride] /= K[i * SIZE + i];
            }
    if (!eigenvalues(SIZE, M, mu, e)) return INDEFINITE;
    for (int i = 1; i < SIZE; i++) /* descending */
        for (int j = i; j > 0 && mu[j] > mu[j - 1]; j--) {
            double t = mu[j];
            mu[j] = mu[j - 1];
            mu[j - 1] = t;
        }
    for (int i = 0; i < N_MODES; i++)
        hz[i] = 1.0 / (6.283185307179586 * sqrt(mu[MODES[i] - 1]));
    return OK;
}
