"""The coupon suite: pictures of coupons that were cut with known kerfs, as from scanners and phones.

``photograph`` makes a picture, ``cases`` draws random coupons and views, ``measure`` reads them and pools the errors.
"""
