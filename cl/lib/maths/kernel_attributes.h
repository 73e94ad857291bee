// Declarations of kernels that trace rays and of the functions they call.
#pragma once

// One ray per lane. Rays diverge at once, so the vectors of sixteen work items that Intel's CPU compiler
// would form run half as fast.
#if defined(__has_attribute)
#if __has_attribute(intel_vec_len_hint)
#define TRACING_KERNEL __kernel __attribute__((intel_vec_len_hint(1)))
#endif
#endif
#ifndef TRACING_KERNEL
#define TRACING_KERNEL __kernel
#endif

// Rereads a value at each use. The compiler would otherwise hoist computations from it out of a loop over
// rays and keep their results in registers along each ray.
#define READ_AGAIN(pointer) (*(volatile __global const int *)(pointer))

// Inlines functions that take the world by value: a call would copy it to the stack of each work item. -D
// WITHOUT_INLINING is for the simulator Oclgrind, which does not support all the code inlining produces.
#ifdef WITHOUT_INLINING
#define ALWAYS_INLINE
#else
#define ALWAYS_INLINE __attribute__((always_inline))
#endif
