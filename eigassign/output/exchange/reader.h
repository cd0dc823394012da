/* Natural frequencies of a mechanism from its reduced model: @ABOUT@
 *
 * Near the poses and designs that the model was made for it is as accurate as was asked for; it does
 * not estimate its error. C99, without other libraries than libm; no allocation; no global state.
 */
#ifndef @MACRO@_H
#define @MACRO@_H

#define @MACRO@_N_Q @N_Q@         /* coordinates q, rad or m */
#define @MACRO@_N_Y @N_Y@         /* design parameters y, SI */
#define @MACRO@_N_MODES @N_MODES@ /* modes @MODES@, counted from the lowest elastic one */
#define @MACRO@_SIZE @SIZE@       /* order k of the reduced matrices */

/* What the functions return. */
#define @MACRO@_OK 0
#define @MACRO@_DOMAIN 1   /* q or y is not where the model was made for, or no section has it */
#define @MACRO@_LOOP 2     /* a closed loop cannot be closed there, or is at a dead point */
#define @MACRO@_INDEFINITE 3 /* K is not positive definite, or a free coordinate moves no mass */

#ifdef __cplusplus
extern "C" {
#endif

/* hz[N_MODES]: frequencies in Hz at q[N_Q] and y[N_Y]; NaN where it does not return 0. */
int @NAME@_frequencies(const double *q, const double *y, double *hz);

/* K[SIZE * SIZE], M[SIZE * SIZE] of K phi = (2 pi f)^2 M phi, rigid-body motion projected out. */
int @NAME@_matrices(const double *q, const double *y, double *K, double *M);

#ifdef __cplusplus
}
#endif
#endif
