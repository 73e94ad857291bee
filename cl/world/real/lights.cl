// Sampling table of the panorama's light (lib/world/real/lights.h).
//
//   kernel         in                                  out
//   sum_luminance  texels, hidden_light (remember.cl)  mean luminance of cells
//   sum_columns    luminance                           light of each column of cells
//   find_excess    luminance, light                    excess of each cell over the mean, and sums down
//                                                      each column
//   make_lights    excess, sums                        the table
//
// In the last three an item is a column: its loads are beside its neighbours', and each order of summation
// is fixed.
#include "maths/equirect.h"
#include "maths/maths.h"

// Rounding errors are not light: an even panorama has no excess.
#define EVEN 1e-4f

__kernel void sum_luminance(
    const int width,
    const int height,
    const int columns,                             // of cells; at most one a texel
    const int rows,
    __global const float *restrict texels,         // 3 a texel
    __global const float *restrict hidden_light,   // or null
    __global float *restrict mean)                 // out: columns x rows
{
    const int column = get_global_id(0), row = get_global_id(1);
    if (column >= columns || row >= rows)
        return;
    // The texels that the cell's range of row and column indices maps to.
    const int x0 = (column * width + columns - 1) / columns;
    const int x1 = ((column + 1) * width + columns - 1) / columns;
    const int y0 = (row * height + rows - 1) / rows, y1 = ((row + 1) * height + rows - 1) / rows;
    float sum = 0.0f;
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            const float light = luminance(vload3(y * width + x, texels));
            sum += hidden_light ? fmax(light, hidden_light[y * width + x]) : light;
        }
    mean[row * columns + column] = sum / (float)((x1 - x0) * (y1 - y0));
}

__kernel void sum_columns(
    const int columns,
    const int rows,
    __global const float *restrict luminance,     // columns x rows
    __global const float *restrict solid_angle,   // of a cell of each row, in sr
    __global float *restrict light)               // out, per column
{
    const int x = get_global_id(0);
    if (x >= columns)
        return;
    float sum = 0.0f;
    for (int y = 0; y < rows; y++)
        sum += luminance[y * columns + x] * solid_angle[y];
    light[x] = sum;
}

__kernel void find_excess(
    const int columns,
    const int rows,
    __global const float *restrict luminance,
    __global const float *restrict solid_angle,
    __global const float *restrict light,
    __global float *restrict density,             // out: excess, columns x rows
    __global float *restrict share,               // out: flux of the excess, down to each cell and with it
    __global float *restrict excess)              // out: flux of the excess of each column
{
    const int x = get_global_id(0);
    if (x >= columns)
        return;
    float all = 0.0f;
    for (int i = 0; i < columns; i++)
        all += light[i];
    const float mean = all / (4.0f * IPRT_PI);
    float sum = 0.0f;
    for (int y = 0; y < rows; y++) {
        const int cell = y * columns + x;
        const float over = luminance[cell] > mean * (1.0f + EVEN) ? luminance[cell] - mean : 0.0f;
        sum += over * solid_angle[y];
        density[cell] = over;
        share[cell] = sum;
    }
    excess[x] = sum;
}

// Return part / whole, exactly 1 where they are equal: divisions of some devices are not exact.
static inline float fraction(float part, float whole)
{
    return !(whole > 0.0f) ? 0.0f : part >= whole ? 1.0f : part / whole;
}

__kernel void make_lights(
    const int columns,
    const int rows,
    __global const float *restrict excess,
    __global float *restrict density,             // excess; out: as in lib/world/real/lights.h
    __global float *restrict share,               // sums of flux; out: likewise
    __global float *restrict column)              // out: likewise
{
    const int x = get_global_id(0);
    if (x >= columns)
        return;
    float before = 0.0f, all = 0.0f;
    for (int i = 0; i < columns; i++) {
        before = i == x ? all : before;
        all += excess[i];
    }
    column[x] = fraction(before, all);
    if (x == columns - 1)
        column[columns] = fraction(all, all);
    const float own = excess[x];
    for (int y = 0; y < rows; y++) {
        const int cell = y * columns + x;
        density[cell] = all > 0.0f ? density[cell] / all : 0.0f;
        share[cell] = fraction(share[cell], own);
    }
}
