#include "import_check.h"
#include <string.h>

hw_words hw_words_make(const void *data, size_t size, char comment)
{
    const char *text = data;
    return (hw_words){.next = text, .end = text, .file_end = text + size, .comment = comment};
}

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

static void skip_blanks(hw_words *w)
{
    while (w->next < w->end && is_blank(*w->next))
        w->next++;
}

bool hw_words_line(hw_words *w)
{
    for (;;) {
        const char *start = w->line == 0 ? w->end : w->end + 1; // past the newline
        if (start >= w->file_end)
            return false;
        const char *newline = memchr(start, '\n', (size_t)(w->file_end - start));
        w->next = start;
        w->end = newline ? newline : w->file_end;
        w->line++;
        skip_blanks(w);
        if (w->next < w->end && !(w->comment && *w->next == w->comment))
            return true;
    }
}

bool hw_words_get(hw_words *w, const char **word, size_t *length)
{
    skip_blanks(w);
    if (w->next == w->end || (w->comment && *w->next == w->comment))
        return false;
    *word = w->next;
    while (w->next < w->end && !is_blank(*w->next) && !(w->comment && *w->next == w->comment))
        w->next++;
    *length = (size_t)(w->next - *word);
    return true;
}

static bool parse_integer(const char *word, size_t length, int64_t *out)
{
    bool negative = length > 0 && word[0] == '-';
    size_t i = length > 0 && (word[0] == '-' || word[0] == '+');
    if (i == length || length > 18)
        return false;
    int64_t value = 0;
    for (; i < length; i++) {
        if (word[i] < '0' || word[i] > '9')
            return false;
        value = value * 10 + (word[i] - '0');
    }
    *out = negative ? -value : value;
    return true;
}

bool hw_words_integer(hw_words *w, int64_t *out)
{
    const char *word;
    size_t length;
    return hw_words_get(w, &word, &length) && parse_integer(word, length, out);
}

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static size_t skip_digits(const char *word, size_t length, size_t i)
{
    while (i < length && is_digit(word[i]))
        i++;
    return i;
}

static bool is_number(const char *word, size_t length)
{
    size_t i = length > 0 && (word[0] == '-' || word[0] == '+');
    size_t rest = length - i;
    if ((rest == 3 && (memcmp(word + i, "nan", 3) == 0 || memcmp(word + i, "inf", 3) == 0)))
        return true;
    size_t whole = skip_digits(word, length, i), digits = whole - i;
    i = whole;
    if (i < length && word[i] == '.') {
        size_t fraction = skip_digits(word, length, i + 1);
        digits += fraction - i - 1;
        i = fraction;
    }
    if (digits == 0)
        return false;
    if (i < length && (word[i] == 'e' || word[i] == 'E')) {
        i++;
        i += i < length && (word[i] == '-' || word[i] == '+');
        size_t exponent = skip_digits(word, length, i);
        if (exponent == i)
            return false;
        i = exponent;
    }
    return i == length;
}

bool hw_words_number(hw_words *w)
{
    const char *word;
    size_t length;
    return hw_words_get(w, &word, &length) && is_number(word, length);
}
