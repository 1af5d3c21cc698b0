static inline double min(const double a, const double b)
{
    return b < a ? b : a;
}


static inline double max(const double a, const double b)
{
    return b > a ? b : a;
}


static inline int64_t min_int(const int64_t a, const int64_t b)
{
    return b < a ? b : a;
}


static inline int64_t max_int(const int64_t a, const int64_t b)
{
    return b > a ? b : a;
}


/* 2^-k of a whole k: the last bits of 1.5*2^52 + 1023 - k, in the exponent's place */
static inline double half_to(const double k)
{
    union {
        double number;
        uint64_t bits;
    } sum;

    sum.number = 6755399441055744.0 + 1023.0 - k;
    sum.bits <<= 52;
    return sum.number;
}


/* the newest first, and what was there one place on */
static inline ROW ROW_shifted(ITEM newest, const ROW *past)
{
    ROW moved;

    moved.at[0] = newest;
    for (int i = 1; i < LENGTH; ++i) {
        moved.at[i] = past->at[i - 1];
    }
    return moved;
}
