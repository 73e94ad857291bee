// How kernels that trace rays, and what they call, are declared.
#ifndef IPRT_TRACING_H
#define IPRT_TRACING_H

// One ray per lane: rays part ways at once, so that Intel's CPU compiler, which
// would pack sixteen of them into a vector, makes code that is half as fast.
#if defined(__has_attribute)
#if __has_attribute(intel_vec_len_hint)
#define TRACING_KERNEL __kernel __attribute__((intel_vec_len_hint(1)))
#endif
#endif
#ifndef TRACING_KERNEL
#define TRACING_KERNEL __kernel
#endif

// Reads it anew each time. What a loop over rays computes from it would else be computed before the
// loop, and held in registers all along each ray.
#define READ_AGAIN(pointer) (*(volatile __global const int *)(pointer))

// Functions that are given the world by value: a call would copy it to the stack of each work item.
// -D WITHOUT_INLINING is for a simulator, Oclgrind, that does not know all that inlining leaves.
#ifdef WITHOUT_INLINING
#define ALWAYS_INLINE
#else
#define ALWAYS_INLINE __attribute__((always_inline))
#endif

#endif
