/* The cost of one look-up and of many from C: see benches/bindings.sh.
 *
 *     time DATASET
 */
#define _POSIX_C_SOURCE 199309L
#include <haptize.h>

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { PLACES = 4096, BLOCKS = 500, MANY = 1000000 };

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int count, char **arguments)
{
    char message[512];
    hz_field *field;
    uint32_t joints, joint, state = 1;
    double least[HZ_MAX_JOINTS], greatest[HZ_MAX_JOINTS], tau[HZ_MAX_JOINTS], blocks[BLOCKS], begin, *q, *many;
    size_t k, block;

    if (count != 2 || hz_field_open(arguments[1], &field, message, sizeof message) != HZ_OK) {
        fprintf(stderr, "%s\n", count == 2 ? message : "usage: time DATASET");
        return EXIT_FAILURE;
    }
    joints = hz_field_joints(field);
    hz_field_bounds(field, least, greatest);
    q = malloc(sizeof *q * MANY * joints);
    many = malloc(sizeof *many * MANY * joints);
    if (!q || !many)
        return EXIT_FAILURE;
    for (k = 0; k < MANY; k++)
        for (joint = 0; joint < joints; joint++) {
            state = state * 1103515245u + 12345u;
            q[k * joints + joint] = least[joint] + (greatest[joint] - least[joint]) * (state >> 16 & 0x7fff) / 32768.0;
        }
    for (block = 0; block < BLOCKS; block++) {
        begin = seconds();
        for (k = 0; k < PLACES; k++)
            hz_field_torque(field, q + k * joints, tau);
        blocks[block] = (seconds() - begin) / PLACES * 1e9;
    }
    qsort(blocks, BLOCKS, sizeof *blocks, ascending);
    hz_field_torques(field, MANY, q, many, NULL);
    begin = seconds();
    hz_field_torques(field, MANY, q, many, NULL);
    printf("C       %6.0f ns a look-up, %6.2f million a second in a batch\n", blocks[BLOCKS / 2], MANY / (seconds() - begin) / 1e6);
    free(q);
    free(many);
    hz_field_close(field);
    return EXIT_SUCCESS;
}
